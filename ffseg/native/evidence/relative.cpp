#include "evidence/relative.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/lanes.hpp"
#include "evidence/elementary.hpp"

namespace ffseg::evidence {
namespace {

struct Moments {
    double mean[3] = {0, 0, 0}, deviation[3] = {0, 0, 0};
};

Moments moments_inside(const float* lab, const std::uint8_t* inside, std::size_t count) {
    std::vector<std::size_t> places;
    for (std::size_t i = 0; i < count; ++i) {
        if (inside[i] != 0) places.push_back(i);
    }
    Moments moments;
    const auto pixels = static_cast<double>(places.size());
    for (std::size_t c = 0; c < 3 && !places.empty(); ++c) {
        const float* plane = lab + c * count;
        double sum = 0, squares = 0;
        for (const std::size_t i : places) {
            sum += plane[i];
            squares += double{plane[i]} * plane[i];
        }
        moments.mean[c] = sum / pixels;
        moments.deviation[c] = std::sqrt(std::max(0.0, squares / pixels - moments.mean[c] * moments.mean[c]));
    }
    return moments;
}

// One pixel after the other of three planes: less their means, and how many deviations that is away.
FFSEG_CLONES
void compare(const float* lab, const float* mean, const float* scale, std::size_t count, float* out) {
    const float light = mean[0], red = mean[1], blue = mean[2];
    const float by_light = scale[0], by_red = scale[1], by_blue = scale[2];
    const float *of_light = lab, *of_red = lab + count, *of_blue = lab + 2 * count;
    float *to_light = out, *to_red = out + count, *to_blue = out + 2 * count, *length = out + 3 * count;
    FFSEG_APART
    for (std::size_t i = 0; i < count; ++i) {
        const float l = of_light[i] - light, a = of_red[i] - red, b = of_blue[i] - blue;
        const float x = l * by_light, y = a * by_red, z = b * by_blue;
        to_light[i] = l;
        to_red[i] = a;
        to_blue[i] = b;
        length[i] = std::sqrt((x * x + y * y) + z * z);
    }
}

constexpr int kLight = 24, kColour = 20, kBins = kLight * kColour * kColour;
constexpr float kMaxColour = 50.0F;  // of a and b either way; what is beyond counts as there
constexpr double kEmpty = 1e-6;           // share of a colour that was never seen

using Histogram = std::vector<double>;

FFSEG_PART inline int bin_of(float value, float low, float span, int bins) {
    return std::min(std::max(static_cast<int>((value - low) / span * static_cast<float>(bins)), 0), bins - 1);
}

FFSEG_CLONES
void find_bins(const float* light, const float* red, const float* blue, std::size_t count, int* bins) {
    FFSEG_APART
    for (std::size_t i = 0; i < count; ++i) {
        const int l = bin_of(light[i], 0, 100, kLight);
        const int a = bin_of(red[i], -kMaxColour, 2 * kMaxColour, kColour);
        const int b = bin_of(blue[i], -kMaxColour, 2 * kMaxColour, kColour);
        bins[i] = (l * kColour + a) * kColour + b;
    }
}

// Weights 1 2 1 of lines of `length` values one after another, each `stride` numbers wide; at the ends the last
// repeats.
void smooth_lines(const double* from, int length, int stride, double* to) {
    for (int i = 0; i < length; ++i) {
        const double *here = from + i * stride, *low = i > 0 ? here - stride : here;
        const double* high = i + 1 < length ? here + stride : here;
        double* out = to + i * stride;
        FFSEG_APART
        for (int k = 0; k < stride; ++k) out[k] = (low[k] + 2 * here[k] + high[k]) / 4;
    }
}

// Applied twice along one axis.
void smooth_axis(Histogram& bins, int length, int stride) {
    Histogram once(bins.size());
    for (int start = 0; start < kBins; start += length * stride) {
        smooth_lines(bins.data() + start, length, stride, once.data() + start);
        smooth_lines(once.data() + start, length, stride, bins.data() + start);
    }
}

void finish(Histogram& bins) {
    smooth_axis(bins, kLight, kColour * kColour);
    smooth_axis(bins, kColour, kColour);
    smooth_axis(bins, kColour, 1);
    double sum = 0;
    for (const double one : bins) sum += one;
    for (double& one : bins) one /= std::max(sum, 1.0);
}

}  // namespace

void relative_colour(const float* lab, const std::uint8_t* inside, Size size, double floor, const Pixels& some,
                     float* out) {
    const Moments moments = moments_inside(lab, inside, size.count());
    float mean[3], scale[3];
    for (std::size_t c = 0; c < 3; ++c) {
        mean[c] = static_cast<float>(moments.mean[c]);
        scale[c] = static_cast<float>(1 / (moments.deviation[c] + floor));
    }
    compare(some.lab, mean, scale, some.count, out);
}

void likelihood_ratio(const float* lab, const std::uint8_t* inside, Size size, float* out) {
    const std::size_t count = size.count();
    Histogram within(kBins), all(kBins);
    std::vector<int> bins(count);
    find_bins(lab, lab + count, lab + 2 * count, count, bins.data());
    for (std::size_t i = 0; i < count; ++i) {
        const auto at = static_cast<std::size_t>(bins[i]);
        all[at] += 1;
        if (inside[i] != 0) within[at] += 1;
    }
    std::vector<std::size_t> present;  // few of all colours
    for (std::size_t k = 0; k < kBins; ++k) {
        if (all[k] > 0) present.push_back(k);
    }
    finish(within);
    finish(all);
    std::vector<float> ratios(kBins);
    for (const std::size_t k : present) {
        ratios[k] = static_cast<float>(logarithm((within[k] + kEmpty) / (all[k] + kEmpty)));
    }
    for (std::size_t i = 0; i < count; ++i) out[i] = ratios[static_cast<std::size_t>(bins[i])];
}

}  // namespace ffseg::evidence
