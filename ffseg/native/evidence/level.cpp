#include "evidence/level.hpp"

#include <algorithm>
#include <cmath>

namespace ffseg::evidence {
namespace {

// Beyond so many standard deviations a bell adds nothing.
constexpr float kFarBell = 4.0F;

// Pixels: farther from the level than any bell reaches.
constexpr float kFar = 1e6F;
constexpr float kDiagonal = 1.41421356F;

float bell(float distance, float deviation) {
    const float scaled = distance / deviation;
    return scaled > kFarBell ? 0.0F : std::exp(-0.5F * scaled * scaled);
}

class Level {
public:
    Level(const float* above, Size size) : above_(above), size_(size) {}

    float at(int y, int x) const {
        const int row = std::clamp(y, 0, size_.height - 1), column = std::clamp(x, 0, size_.width - 1);
        return above_[static_cast<std::ptrdiff_t>(row) * size_.width + column];
    }
    bool crosses(int y, int x) const {
        const bool here = at(y, x) >= 0;
        return (at(y - 1, x) >= 0) != here || (at(y + 1, x) >= 0) != here || (at(y, x - 1) >= 0) != here ||
               (at(y, x + 1) >= 0) != here;
    }
    // Distances to the level: value over slope beside it, and from there in steps to the eight neighbours.
    Plane distances() const {
        Plane found(size_.count(), kFar);
        std::size_t i = 0;
        for (int y = 0; y < size_.height; ++y) {
            for (int x = 0; x < size_.width; ++x, ++i) {
                if (crosses(y, x)) found[i] = distance_beside(y, x);
            }
        }
        for (int y = 0; y < size_.height; ++y) sweep(found, y, -1);
        for (int y = size_.height - 1; y >= 0; --y) sweep(found, y, 1);
        return found;
    }

private:
    float distance_beside(int y, int x) const {
        const float across = 0.5F * (at(y, x + 1) - at(y, x - 1)), down = 0.5F * (at(y + 1, x) - at(y - 1, x));
        const float slope = std::sqrt(across * across + down * down);
        return std::min(std::abs(at(y, x)) / std::max(slope, 1e-6F), 1.0F);
    }
    // Carries distances over from the row before (`side` -1: above) and along the row, both ways.
    void sweep(Plane& found, int y, int side) const {
        const int width = size_.width;
        float* row = found.data() + static_cast<std::ptrdiff_t>(y) * width;
        if (y + side >= 0 && y + side < size_.height) {
            const float* beside = row + static_cast<std::ptrdiff_t>(side) * width;
            for (int x = 0; x < width; ++x) {
                const float left = beside[std::max(x - 1, 0)], right = beside[std::min(x + 1, width - 1)];
                row[x] = std::min({row[x], beside[x] + 1, left + kDiagonal, right + kDiagonal});
            }
        }
        for (int x = 1; x < width; ++x) row[x] = std::min(row[x], row[x - 1] + 1);
        for (int x = width - 2; x >= 0; --x) row[x] = std::min(row[x], row[x + 1] + 1);
    }

    const float* above_;
    Size size_;
};

}  // namespace

void level_edges(const float* above, Size size, const LevelOptions& options, std::uint16_t* gradient,
                 std::uint8_t* edges) {
    const Level level(above, size);
    const Plane distances = level.distances();
    std::size_t i = 0;
    for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x, ++i) {
            const bool undecided = std::abs(above[i]) < options.undecided;
            const float share = undecided ? 1.0F : bell(distances[i], options.snap);
            const float ridge = options.height * bell(distances[i], options.width);
            const float sum = static_cast<float>(gradient[i]) * share + ridge;
            gradient[i] = static_cast<std::uint16_t>(std::min(sum + 0.5F, 65535.0F));
            edges[i] = (above[i] < 0 && level.crosses(y, x)) || (undecided && edges[i] != 0) ? 255 : 0;
        }
    }
}

}  // namespace ffseg::evidence
