#include "edges/smooth.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "common/lanes.hpp"

namespace ffseg::edges {
namespace {

// Pairs of pixels weighed in one pass over a row; more would not leave the compiler enough registers.
constexpr int kPairs = 6;

constexpr double kWhole = 65536.0;

// The high half of a product, which loses half a unit on average; see `rounding`.
FFSEG_PART inline std::uint16_t share(std::uint16_t a, std::uint16_t b, std::uint16_t weight) {
    const std::uint16_t sum = static_cast<std::uint16_t>(a + b);
    return static_cast<std::uint16_t>((static_cast<std::uint32_t>(sum) * weight) >> 16);
}

// What the cut products of all pairs lose on average.
std::uint16_t rounding(const Gaussian& kernel) { return static_cast<std::uint16_t>(kernel.weights.size() / 2); }

// The pairs weighed in one pass over a row, and whether it is the first or the last one.
struct Pass {
    int from;
    bool first, last;
};

template <std::size_t... I>
FFSEG_PART inline void across(const std::uint16_t* left, const std::uint16_t* right, const std::uint16_t* weights,
                              std::uint16_t start, std::uint16_t* out, int count, Pass pass,
                              std::index_sequence<I...>) {
    const std::uint16_t w[] = {weights[I]...};
    FFSEG_APART
    for (int x = 0; x < count; ++x) {
        const std::uint16_t before = pass.first ? start : out[x];
        out[x] = static_cast<std::uint16_t>(
            before + (share(left[x - static_cast<int>(I)], right[x + static_cast<int>(I)], w[I]) + ...));
    }
}

template <std::size_t... I>
FFSEG_PART inline void down(const std::uint16_t* const* above, const std::uint16_t* const* below,
                            const std::uint16_t* weights, std::uint16_t start, std::uint16_t* out, int count, Pass pass,
                            std::index_sequence<I...>) {
    constexpr int kShift = kAcrossBits - kSmoothedBits;
    const std::uint16_t* const a[] = {above[I]...};
    const std::uint16_t* const b[] = {below[I]...};
    const std::uint16_t w[] = {weights[I]...};
    FFSEG_APART
    for (int x = 0; x < count; ++x) {
        const std::uint16_t before = pass.first ? start : out[x];
        const std::uint16_t sum = static_cast<std::uint16_t>(before + (share(a[I][x], b[I][x], w[I]) + ...));
        out[x] = pass.last ? static_cast<std::uint16_t>(sum >> kShift) : sum;
    }
}

// Call `weigh(pass, number of pairs as a type)` until all pairs of a kernel are weighed.
template <class Weigh>
FFSEG_PART inline void in_passes(const Gaussian& kernel, Weigh weigh) {
    const int pairs = static_cast<int>(kernel.weights.size());
    for (int from = 0; from < pairs; from += kPairs) {
        const Pass pass{from, from == 0, from + kPairs >= pairs};
        switch (std::min(pairs - from, kPairs)) {
            case 1: weigh(pass, std::make_index_sequence<1>{}); break;
            case 2: weigh(pass, std::make_index_sequence<2>{}); break;
            case 3: weigh(pass, std::make_index_sequence<3>{}); break;
            case 4: weigh(pass, std::make_index_sequence<4>{}); break;
            case 5: weigh(pass, std::make_index_sequence<5>{}); break;
            default: weigh(pass, std::make_index_sequence<kPairs>{}); break;
        }
    }
}

}  // namespace

Gaussian gaussian(double sigma) {
    const auto height = [sigma](int k) { return std::exp(-0.5 * (k / sigma) * (k / sigma)); };
    const double least = std::sqrt(2 * 3.14159265358979323846) * sigma / (255.0 * (1 << kSmoothedBits));
    std::vector<double> heights{1.0};
    while (height(static_cast<int>(heights.size())) > least)
        heights.push_back(height(static_cast<int>(heights.size())));
    double total = 1.0;
    for (std::size_t k = 1; k < heights.size(); ++k) total += 2 * heights[k];
    Gaussian made;
    long left = std::lround(kWhole / 2);
    made.weights.assign(heights.size(), 0);
    for (std::size_t k = 1; k < heights.size(); ++k) {
        made.weights[k] = static_cast<std::uint16_t>(std::lround(kWhole * heights[k] / total));
        left -= made.weights[k];
    }
    made.weights[0] = static_cast<std::uint16_t>(left);
    return made;
}

FFSEG_CLONES
void widen_row(const std::uint8_t* row, int step, std::uint16_t* out, int width) {
    const std::uint8_t* __restrict from = row;
    std::uint16_t* __restrict to = out;
    if (step == 1) {
        for (int x = 0; x < width; ++x) to[x] = static_cast<std::uint16_t>(from[x] << kAcrossBits);
    } else if (step == 3) {
        for (int x = 0; x < width; ++x) to[x] = static_cast<std::uint16_t>(from[3 * x] << kAcrossBits);
    } else {
        for (int x = 0; x < width; ++x) to[x] = static_cast<std::uint16_t>(from[step * x] << kAcrossBits);
    }
}

FFSEG_CLONES
void smooth_across(const std::uint16_t* row, const Gaussian& kernel, std::uint16_t* out, int count) {
    const std::uint16_t start = rounding(kernel);
    const std::uint16_t* const weights = kernel.weights.data();
    in_passes(kernel, [=](Pass pass, auto pairs) FFSEG_PART {
        across(row - pass.from, row + pass.from, weights + pass.from, start, out, count, pass, pairs);
    });
}

FFSEG_CLONES
void smooth_down(const std::uint16_t* const* above, const std::uint16_t* const* below, const Gaussian& kernel,
                 std::uint16_t* out, int count) {
    const std::uint16_t start = static_cast<std::uint16_t>(rounding(kernel) + (1 << (kAcrossBits - kSmoothedBits)) / 2);
    const std::uint16_t* const weights = kernel.weights.data();
    in_passes(kernel, [=](Pass pass, auto pairs) FFSEG_PART {
        down(above + pass.from, below + pass.from, weights + pass.from, start, out, count, pass, pairs);
    });
}

}  // namespace ffseg::edges
