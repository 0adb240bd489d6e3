#include "evidence/blur.hpp"

#include <algorithm>
#include <cmath>

#include "common/lanes.hpp"

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

}  // namespace ffseg::evidence
