#include "evidence/level.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/lanes.hpp"
#include "evidence/elementary.hpp"

namespace ffseg::evidence {
namespace {

// Beyond so many standard deviations a bell adds nothing.
constexpr float kFarBell = 4.0F;

// Pixels: farther from the level than any bell reaches.
constexpr float kFar = 1e6F;
constexpr float kDiagonal = 1.41421356F;

FFSEG_PART inline float bell(float distance, float deviation) {
    const float scaled = distance / deviation, seen = scaled > kFarBell ? 0.0F : 1.0F;
    return exponential(-0.5F * scaled * scaled) * seen;  // a product, where choices would wait for each pixel
}

// 1 where a value differs in sign from a neighbour to the left or right, above or below.
FFSEG_CLONES
void crossings_of_row(const std::uint8_t* above, const std::uint8_t* here, const std::uint8_t* below, int width,
                      std::uint8_t* out) {
    FFSEG_APART
    for (int x = 1; x < width - 1; ++x) {
        out[x] = (here[x] ^ here[x - 1]) | (here[x] ^ here[x + 1]) | (here[x] ^ above[x]) | (here[x] ^ below[x]);
    }
}

std::vector<std::uint8_t> crossings(const float* values, Size size) {
    std::vector<std::uint8_t> signs(size.count()), found(size.count());
    for (std::size_t i = 0; i < size.count(); ++i) signs[i] = values[i] >= 0 ? 1 : 0;
    const int width = size.width;
    for (int y = 0; y < size.height; ++y) {
        const auto row = [&](int at) {
            return signs.data() + static_cast<std::ptrdiff_t>(std::clamp(at, 0, size.height - 1)) * width;
        };
        const std::uint8_t *above = row(y - 1), *here = row(y), *below = row(y + 1);
        std::uint8_t* out = found.data() + static_cast<std::ptrdiff_t>(y) * width;
        crossings_of_row(above, here, below, width, out);
        for (const int x : {0, width - 1}) {
            const int left = std::max(x - 1, 0), right = std::min(x + 1, width - 1);
            out[x] = (here[x] ^ here[left]) | (here[x] ^ here[right]) | (here[x] ^ above[x]) | (here[x] ^ below[x]);
        }
    }
    return found;
}

// Each value at most those `apart` pixels to the left and right and that length more.
FFSEG_CLONES
void reach_along(const float* row, int width, int apart, float* out) {
    const auto length = static_cast<float>(apart);
    const int sides = std::min(apart, width), middle = width - sides;
    for (int x = 0; x < sides; ++x) out[x] = x + apart < width ? std::min(row[x], row[x + apart] + length) : row[x];
    FFSEG_APART
    for (int x = sides; x < middle; ++x) {
        const float nearer = std::min(row[x - apart], row[x + apart]) + length;
        out[x] = std::min(row[x], nearer);
    }
    for (int x = std::max(sides, middle); x < width; ++x) out[x] = std::min(row[x], row[x - apart] + length);
}

// The same from the row beside: straight on, and along the diagonals.
FFSEG_CLONES
void reach_across(const float* beside, int width, float* row) {
    FFSEG_APART
    for (int x = 1; x < width - 1; ++x) {
        const float slanted = std::min(beside[x - 1], beside[x + 1]) + kDiagonal;
        row[x] = std::min(row[x], std::min(beside[x] + 1, slanted));
    }
    for (const int x : {0, width - 1}) {
        const float slanted = std::min(beside[std::max(x - 1, 0)], beside[std::min(x + 1, width - 1)]) + kDiagonal;
        row[x] = std::min(row[x], std::min(beside[x] + 1, slanted));
    }
}

// Distances to the level up to `reach`: value over slope beside it, and from there in steps to the eight neighbours.
class Distances {
public:
    Distances(const float* above, Size size, float reach) : above_(above), size_(size), reach_(reach) {}

    Plane from(const std::vector<std::uint8_t>& crossing) const {
        Plane found(size_.count(), kFar);
        std::vector<std::uint8_t> near(static_cast<std::size_t>(size_.height));  // rows that the level may reach
        const int reach = static_cast<int>(std::ceil(reach_));
        auto at = crossing.begin();
        while ((at = std::find(at, crossing.end(), 1)) != crossing.end()) {
            const auto i = static_cast<int>(at++ - crossing.begin()), y = i / size_.width;
            found[static_cast<std::size_t>(i)] = beside(y, i % size_.width);
            if (near[static_cast<std::size_t>(std::min(y + reach, size_.height - 1))] != 0) continue;
            std::fill(near.begin() + std::max(y - reach, 0), near.begin() + std::min(y + reach + 1, size_.height), 1);
        }
        Plane spare(static_cast<std::size_t>(size_.width));
        for (int y = 0; y < size_.height; ++y) {
            if (near[static_cast<std::size_t>(y)] != 0) sweep(found, y, -1, spare);
        }
        for (int y = size_.height - 1; y >= 0; --y) {
            if (near[static_cast<std::size_t>(y)] != 0) sweep(found, y, 1, spare);
        }
        return found;
    }

private:
    float at(int y, int x) const {
        const int row = std::clamp(y, 0, size_.height - 1), column = std::clamp(x, 0, size_.width - 1);
        return above_[static_cast<std::ptrdiff_t>(row) * size_.width + column];
    }
    float beside(int y, int x) const {
        const float across = 0.5F * (at(y, x + 1) - at(y, x - 1)), down = 0.5F * (at(y + 1, x) - at(y - 1, x));
        const float slope = std::sqrt(across * across + down * down);
        return std::min(std::abs(at(y, x)) / std::max(slope, 1e-6F), 1.0F);
    }
    // Carries distances over from the row before (`side` -1: above) and along the row, in steps of 1, 2, 4, ... pixels.
    void sweep(Plane& found, int y, int side, Plane& spare) const {
        const int width = size_.width;
        float* row = found.data() + static_cast<std::ptrdiff_t>(y) * width;
        if (y + side >= 0 && y + side < size_.height) {
            reach_across(row + static_cast<std::ptrdiff_t>(side) * width, width, row);
        }
        int known = 0;  // distances along the row that are taken into account
        float *from = row, *to = spare.data();
        for (int apart = 1; static_cast<float>(known) < reach_ && known < width; known += apart, apart *= 2) {
            reach_along(from, width, apart, to);
            std::swap(from, to);
        }
        if (from != row) std::copy_n(from, width, row);
    }

    const float* above_;
    Size size_;
    float reach_;
};

// Whether the map has decided, far from its level, in some pixels.
FFSEG_CLONES
bool far_from_all(const float* above, const float* distances, int count, float undecided, float reach) {
    int near = 0;
    FFSEG_APART
    for (int i = 0; i < count; ++i) near |= (std::abs(above[i]) < undecided) | !(distances[i] > reach);
    return near == 0;
}

// Pixels that are looked at together, most of them far from the level.
constexpr int kTogether = 32;

// The gradient of some pixels within the window and where the map is undecided, with a ridge.
FFSEG_CLONES
void write_ridge(const float* above, const float* distances, int count, const LevelOptions& options,
                 std::uint16_t* gradient) {
    const float margin = options.undecided, snap = options.snap, thin = options.width, height = options.height;
    FFSEG_APART
    for (int i = 0; i < count; ++i) {
        const float distance = distances[i], away = std::abs(above[i]) < margin ? 0.0F : distance;
        const float sum = static_cast<float>(gradient[i]) * bell(away, snap) + height * bell(distance, thin);
        gradient[i] = static_cast<std::uint16_t>(static_cast<int>(std::min(sum + 0.5F, 65535.0F)));
    }
}

// The edges of some pixels where the map is undecided, and those of the level.
FFSEG_CLONES
void write_edges(const float* above, const std::uint8_t* crossing, int count, float margin, std::uint8_t* edges) {
    FFSEG_APART
    for (int i = 0; i < count; ++i) {
        const int own = edges[i] != 0, beside = crossing[i], undecided = std::abs(above[i]) < margin;
        const int below = above[i] < 0;
        edges[i] = static_cast<std::uint8_t>(-((own & undecided) | (beside & below)));
    }
}

}  // namespace

void level_edges(const float* above, Size size, const LevelOptions& options, std::uint16_t* gradient,
                 std::uint8_t* edges) {
    const float reach = kFarBell * std::max(options.snap, options.width);
    const std::vector<std::uint8_t> crossing = crossings(above, size);
    const Plane distances = Distances(above, size, reach).from(crossing);
    for (std::size_t first = 0; first < size.count(); first += kTogether) {
        const int count = static_cast<int>(std::min<std::size_t>(size.count() - first, kTogether));
        const float *values = above + first, *apart = distances.data() + first;
        if (far_from_all(values, apart, count, options.undecided, reach)) {
            std::fill_n(gradient + first, count, std::uint16_t{0});
            std::fill_n(edges + first, count, std::uint8_t{0});
        } else {
            write_ridge(values, apart, count, options, gradient + first);
            write_edges(values, crossing.data() + first, count, options.undecided, edges + first);
        }
    }
}

}  // namespace ffseg::evidence
