#include "evidence/relative.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace ffseg::evidence {
namespace {

struct Moments {
    double mean[3] = {0, 0, 0}, deviation[3] = {0, 0, 0};
};

Moments moments_inside(const float* lab, const std::uint8_t* inside, std::size_t count) {
    Moments moments;
    for (std::size_t c = 0; c < 3; ++c) {
        const float* plane = lab + c * count;
        double sum = 0, squares = 0, pixels = 0;
        for (std::size_t i = 0; i < count; ++i) {
            if (inside[i] == 0) continue;
            sum += plane[i];
            squares += double{plane[i]} * plane[i];
            ++pixels;
        }
        if (pixels == 0) continue;
        moments.mean[c] = sum / pixels;
        moments.deviation[c] = std::sqrt(std::max(0.0, squares / pixels - moments.mean[c] * moments.mean[c]));
    }
    return moments;
}

constexpr int kLight = 24, kColour = 20, kBins = kLight * kColour * kColour;
constexpr float kFarthestColour = 50.0F;  // of a and b either way; what is beyond counts as there
constexpr double kEmpty = 1e-6;           // share of a colour that was never seen

using Histogram = std::vector<double>;

int bin_of(float value, float low, float span, int bins) {
    return std::clamp(static_cast<int>((value - low) / span * static_cast<float>(bins)), 0, bins - 1);
}

// Weights 1 2 1 along one axis, applied twice; at the ends the last bin repeats.
void smooth_axis(Histogram& bins, int length, int stride) {
    Histogram before(static_cast<std::size_t>(length));
    for (int start = 0; start < kBins; ++start) {
        if (start / stride % length != 0) continue;
        const auto at = [&](int i) -> double& { return bins[static_cast<std::size_t>(start + i * stride)]; };
        for (int turn = 0; turn < 2; ++turn) {
            for (int i = 0; i < length; ++i) before[static_cast<std::size_t>(i)] = at(i);
            for (int i = 0; i < length; ++i) {
                const double low = before[static_cast<std::size_t>(std::max(i - 1, 0))];
                const double high = before[static_cast<std::size_t>(std::min(i + 1, length - 1))];
                at(i) = (low + 2 * before[static_cast<std::size_t>(i)] + high) / 4;
            }
        }
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

void relative_colour(const float* lab, const std::uint8_t* inside, Size size, double floor, float* out) {
    const std::size_t count = size.count();
    const Moments moments = moments_inside(lab, inside, count);
    float mean[3], scale[3];
    for (std::size_t c = 0; c < 3; ++c) {
        mean[c] = static_cast<float>(moments.mean[c]);
        scale[c] = static_cast<float>(1 / (moments.deviation[c] + floor));
    }
    for (std::size_t i = 0; i < count; ++i) {
        float squares = 0;
        for (std::size_t c = 0; c < 3; ++c) {
            const float apart = lab[c * count + i] - mean[c], scaled = apart * scale[c];
            out[c * count + i] = apart;
            squares += scaled * scaled;
        }
        out[3 * count + i] = std::sqrt(squares);
    }
}

void likelihood_ratio(const float* lab, const std::uint8_t* inside, Size size, float* out) {
    const std::size_t count = size.count();
    Histogram within(kBins), all(kBins);
    std::vector<int> bins(count);
    for (std::size_t i = 0; i < count; ++i) {
        const int light = bin_of(lab[i], 0, 100, kLight);
        const int a = bin_of(lab[count + i], -kFarthestColour, 2 * kFarthestColour, kColour);
        const int b = bin_of(lab[2 * count + i], -kFarthestColour, 2 * kFarthestColour, kColour);
        bins[i] = (light * kColour + a) * kColour + b;
        const auto at = static_cast<std::size_t>(bins[i]);
        all[at] += 1;
        if (inside[i] != 0) within[at] += 1;
    }
    finish(within);
    finish(all);
    std::vector<float> ratios(kBins);
    for (std::size_t k = 0; k < kBins; ++k) {
        ratios[k] = static_cast<float>(std::log((within[k] + kEmpty) / (all[k] + kEmpty)));
    }
    for (std::size_t i = 0; i < count; ++i) out[i] = ratios[static_cast<std::size_t>(bins[i])];
}

}  // namespace ffseg::evidence
