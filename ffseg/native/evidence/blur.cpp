#include "evidence/blur.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

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

// A row, and rows to both sides of it in pairs, each weighed: `rows` are the row itself and then before and after. What
// is worked on side by side stays in registers from the first pair to the last; sums have the same order everywhere.
#if defined(__GNUC__)
using Floats = float __attribute__((vector_size(64)));
constexpr int kLanes = 16, kTogether = 4;

template <int N>
FFSEG_PART inline void weigh_at(const float* const* rows, const std::vector<float>& weights, int x, float* out) {
    Floats sums[N];
    std::memcpy(sums, rows[0] + x, sizeof sums);
    for (Floats& one : sums) one = weights[0] * one;
    for (std::size_t pair = 1; pair < weights.size(); ++pair) {
        const float *to_before = rows[2 * pair - 1] + x, *to_after = rows[2 * pair] + x;
        for (int k = 0; k < N; ++k) {
            Floats before, after;
            std::memcpy(&before, to_before + k * kLanes, sizeof before);
            std::memcpy(&after, to_after + k * kLanes, sizeof after);
            sums[k] = sums[k] + weights[pair] * (before + after);
        }
    }
    std::memcpy(out + x, sums, sizeof sums);
}

FFSEG_WIDE_CLONES
void weigh(const float* const* rows, const std::vector<float>& weights, float* out, int count) {
    int x = 0;
    for (; x + kLanes * kTogether <= count; x += kLanes * kTogether) weigh_at<kTogether>(rows, weights, x, out);
    for (; x + kLanes <= count; x += kLanes) weigh_at<1>(rows, weights, x, out);
    for (; x < count; ++x) {
        float sum = weights[0] * rows[0][x];
        for (std::size_t k = 1; k < weights.size(); ++k) sum += weights[k] * (rows[2 * k - 1][x] + rows[2 * k][x]);
        out[x] = sum;
    }
}
#else
void weigh(const float* const* rows, const std::vector<float>& weights, float* out, int count) {
    for (int x = 0; x < count; ++x) out[x] = weights[0] * rows[0][x];
    for (std::size_t k = 1; k < weights.size(); ++k) {
        for (int x = 0; x < count; ++x) out[x] += weights[k] * (rows[2 * k - 1][x] + rows[2 * k][x]);
    }
}
#endif

// Weight between a pixel and the one `step` further on.
float weight(const float* lab, std::size_t count, std::size_t at, std::size_t step, float falloff) {
    float squares = 0;
    for (std::size_t c = 0; c < 3; ++c) {
        const float apart = lab[c * count + at + step] - lab[c * count + at];
        squares += apart * apart;
    }
    return std::exp(-squares * falloff);
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
            for (std::size_t x = 0; x < columns; ++x) {
                const std::size_t from = y * columns + x, to = (y + 1) * width + x + 1;
                if (x + 1 < columns) right[to] = weight(lab, size.count(), from, 1, falloff);
                if (y + 1 < rows) down[to] = weight(lab, size.count(), from, columns, falloff);
            }
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
    std::vector<const float*> rows(2 * weights.size() - 1);
    const auto take = [&](auto row_at) {
        rows[0] = row_at(0);
        for (int k = 1; k <= radius; ++k) {
            rows[static_cast<std::size_t>(2 * k - 1)] = row_at(-k);
            rows[static_cast<std::size_t>(2 * k)] = row_at(k);
        }
    };
    const float* middle = padded.data() + radius;
    take([middle](int k) { return middle + k; });
    for (int y = 0; y < size.height; ++y) {
        const float* row = plane + static_cast<std::ptrdiff_t>(y) * width;
        std::fill(padded.begin(), padded.begin() + radius, row[0]);
        std::copy(row, row + width, padded.begin() + radius);
        std::fill(padded.end() - radius, padded.end(), row[width - 1]);
        weigh(rows.data(), weights, across.data() + static_cast<std::ptrdiff_t>(y) * width, width);
    }
    for (int y = 0; y < size.height; ++y) {
        take([&](int k) {
            return across.data() + static_cast<std::ptrdiff_t>(std::clamp(y + k, 0, size.height - 1)) * width;
        });
        weigh(rows.data(), weights, out + static_cast<std::ptrdiff_t>(y) * width, width);
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
