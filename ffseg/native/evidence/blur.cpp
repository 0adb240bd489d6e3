#include "evidence/blur.hpp"

#include <algorithm>
#include <cmath>

#include "common/lanes.hpp"
#include "evidence/elementary.hpp"

namespace ffseg::evidence {
namespace {

// Weights of the pixel itself and of the pairs k to both sides.
std::vector<float> weights_of(double sigma) {
    const int radius = std::max(1, static_cast<int>(std::ceil(3 * sigma)));
    std::vector<double> weights;
    double sum = 0;
    for (int k = 0; k <= radius; ++k) {
        weights.push_back(std::exp(-0.5 * k * k / (sigma * sigma)));
        sum += (k == 0 ? 1 : 2) * weights.back();
    }
    std::vector<float> scaled;
    for (const double weight : weights) scaled.push_back(static_cast<float>(weight / sum));
    return scaled;
}

FFSEG_CLONES
void begin_row(const float* row, float weight, float* out, int count) {
    FFSEG_APART
    for (int x = 0; x < count; ++x) out[x] = weight * row[x];
}

FFSEG_CLONES
void add_pair(const float* before, const float* after, float weight, float* out, int count) {
    FFSEG_APART
    for (int x = 0; x < count; ++x) out[x] = out[x] + weight * (before[x] + after[x]);
}

// Two pairs at once: half the traffic, the same order of sums.
FFSEG_CLONES
void add_pairs(const float* const* rows, const float* weights, float* out, int count) {
    const float first = weights[0], second = weights[1];
    const float *a = rows[0], *b = rows[1], *c = rows[2], *d = rows[3];
    FFSEG_APART
    for (int x = 0; x < count; ++x) out[x] = (out[x] + first * (a[x] + b[x])) + second * (c[x] + d[x]);
}

// Adds the pairs `before(k)`, `after(k)` of all k from 1 on.
template <class Before, class After>
void add_all(const std::vector<float>& weights, const Before& before, const After& after, float* out, int count) {
    const int radius = static_cast<int>(weights.size()) - 1;
    int k = 1;
    for (; k + 1 <= radius; k += 2) {
        const float* rows[4] = {before(k), after(k), before(k + 1), after(k + 1)};
        add_pairs(rows, weights.data() + k, out, count);
    }
    if (k <= radius) add_pair(before(k), after(k), weights[static_cast<std::size_t>(k)], out, count);
}

// A weight of e^-30 adds nothing to `kept`; far smaller ones would be denormal, which processors are slow with.
constexpr float kMostFall = 30.0F;

// Weights between pixels of a row and those `step` further on; `count` is the number of values of a plane.
FFSEG_CLONES
void weigh_row(const float* lab, std::size_t count, std::size_t step, float falloff, std::size_t columns, float* out) {
    const float *light = lab, *red = lab + count, *blue = lab + 2 * count;
    FFSEG_APART
    for (std::size_t x = 0; x < columns; ++x) {
        const float l = light[x + step] - light[x], a = red[x + step] - red[x], b = blue[x + step] - blue[x];
        out[x] = exponential(-std::min(((l * l + a * a) + b * b) * falloff, kMostFall));
    }
}

// Weights towards the right and the lower neighbour, with a border of zeros so that every pixel has four; and one over
// the sum of all.
struct Weights {
    std::size_t width;  // of a row with its border: a column before and one behind
    Plane right, down, inverse;

    Weights(const float* lab, Size size, const Diffusion& how)
        : width(static_cast<std::size_t>(size.width) + 2),
          right(width * (static_cast<std::size_t>(size.height) + 2)),
          down(right.size()),
          inverse(right.size()) {
        const auto falloff = static_cast<float>(0.5 / (how.contrast * how.contrast));
        const auto columns = static_cast<std::size_t>(size.width), rows = static_cast<std::size_t>(size.height);
        for (std::size_t y = 0; y < rows; ++y) {
            const float* from = lab + y * columns;
            const std::size_t to = (y + 1) * width + 1;
            weigh_row(from, size.count(), 1, falloff, columns - 1, right.data() + to);
            if (y + 1 < rows) weigh_row(from, size.count(), columns, falloff, columns, down.data() + to);
        }
        for (std::size_t at = width + 1; at < (rows + 1) * width; ++at) {
            inverse[at] = 1 / (static_cast<float>(how.kept) + right[at] + right[at - 1] + down[at] + down[at - width]);
        }
    }
};

FFSEG_CLONES
void step_row(const Weights& by, const float* own, const float* from, std::size_t begin, std::size_t end, float* to) {
    const float *right = by.right.data(), *down = by.down.data(), *inverse = by.inverse.data();
    const std::size_t width = by.width;
    FFSEG_APART
    for (std::size_t at = begin; at < end; ++at) {
        to[at] = (own[at] + right[at] * from[at + 1] + right[at - 1] * from[at - 1] + down[at] * from[at + width] +
                  down[at - width] * from[at - width]) *
                 inverse[at];
    }
}

}  // namespace

void blur(const float* plane, Size size, double sigma, float* out) {
    const std::vector<float> weights = weights_of(sigma);
    const int radius = static_cast<int>(weights.size()) - 1, width = size.width;
    Plane padded(static_cast<std::size_t>(width + 2 * radius)), across(size.count());
    for (int y = 0; y < size.height; ++y) {
        const float* row = plane + static_cast<std::ptrdiff_t>(y) * width;
        float* middle = padded.data() + radius;
        std::fill(padded.begin(), padded.begin() + radius, row[0]);
        std::copy(row, row + width, middle);
        std::fill(padded.end() - radius, padded.end(), row[width - 1]);
        float* target = across.data() + static_cast<std::ptrdiff_t>(y) * width;
        begin_row(middle, weights[0], target, width);
        add_all(weights, [&](int k) { return middle - k; }, [&](int k) { return middle + k; }, target, width);
    }
    const auto row_at = [&](int y) {
        return across.data() + static_cast<std::ptrdiff_t>(std::clamp(y, 0, size.height - 1)) * width;
    };
    for (int y = 0; y < size.height; ++y) {
        float* target = out + static_cast<std::ptrdiff_t>(y) * width;
        begin_row(row_at(y), weights[0], target, width);
        add_all(weights, [&](int k) { return row_at(y - k); }, [&](int k) { return row_at(y + k); }, target, width);
    }
}

void diffuse(const float* values, const float* lab, Size size, const Diffusion& how, float* out) {
    const Weights by(lab, size, how);
    Plane own(by.right.size()), from(own.size()), to(own.size());
    const auto columns = static_cast<std::size_t>(size.width), rows = static_cast<std::size_t>(size.height);
    for (std::size_t y = 0; y < rows; ++y) {
        for (std::size_t x = 0; x < columns; ++x) {
            const std::size_t at = (y + 1) * by.width + x + 1;
            from[at] = values[y * columns + x];
            own[at] = static_cast<float>(how.kept) * from[at];
        }
    }
    for (int step = 0; step < how.steps; ++step) {
        for (std::size_t y = 1; y <= rows; ++y) {
            step_row(by, own.data(), from.data(), y * by.width + 1, y * by.width + 1 + columns, to.data());
        }
        from.swap(to);
    }
    for (std::size_t y = 0; y < rows; ++y) {
        for (std::size_t x = 0; x < columns; ++x) out[y * columns + x] = from[(y + 1) * by.width + x + 1];
    }
}

}  // namespace ffseg::evidence
