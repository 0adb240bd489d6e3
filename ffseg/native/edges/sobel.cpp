#include "edges/sobel.hpp"

#include <algorithm>
#include <cmath>

#include "common/lanes.hpp"

namespace ffseg::edges {
namespace {

// tan(22.5 deg) * 65536
constexpr std::uint32_t kSlant = 27146;

// A Sobel sum is 8 times the slope, and both are counted in 1/32 grey level. Rounded down twice is rounded down once.
constexpr int kSumBits = 3;

// The type of every value is that of the lanes it is computed in.
FFSEG_PART inline std::int16_t narrow(int value) { return static_cast<std::int16_t>(value); }

FFSEG_PART inline std::int16_t slope_x(const ThreeRows& rows, int x) {
    return narrow((rows.above[x + 1] - rows.above[x - 1]) + 2 * (rows.here[x + 1] - rows.here[x - 1]) +
                  (rows.below[x + 1] - rows.below[x - 1]));
}

FFSEG_PART inline std::int16_t slope_y(const ThreeRows& rows, int x) {
    return narrow((rows.below[x - 1] - rows.above[x - 1]) + 2 * (rows.below[x] - rows.above[x]) +
                  (rows.below[x + 1] - rows.above[x + 1]));
}

FFSEG_PART inline std::uint16_t size_of(std::int16_t value) {
    const std::int16_t sign = narrow(value >> 15);
    return static_cast<std::uint16_t>((value ^ sign) - sign);
}

// The part of a size that stands for tan(22.5 deg), rounded down.
FFSEG_PART inline std::uint16_t slant(std::uint16_t size) { return static_cast<std::uint16_t>((size * kSlant) >> 16); }

FFSEG_PART inline std::uint16_t magnitude(std::int16_t gx, std::int16_t gy) {
    const float squared = static_cast<float>(gx * gx + gy * gy);
    const std::uint16_t root = static_cast<std::uint16_t>(static_cast<int>(std::sqrt(squared)));
    return static_cast<std::uint16_t>((root + (1 << kSumBits) / 2) >> kSumBits);
}

FFSEG_PART inline std::uint16_t direction(std::int16_t gx, std::int16_t gy) {
    const std::uint16_t ax = size_of(gx), ay = size_of(gy);
    const std::uint16_t slanted = narrow(gx ^ gy) < 0 ? kRising : kFalling;
    const std::uint16_t steep = ax <= slant(ay) ? std::uint16_t{kDown} : slanted;
    return ay <= slant(ax) ? std::uint16_t{kAcross} : steep;
}

}  // namespace

FFSEG_CLONES
void slope_row(ThreeRows smoothed, SlopeRow out, int count) {
    const ThreeRows rows = smoothed;
    std::int16_t* __restrict gx = out.gx;
    std::int16_t* __restrict gy = out.gy;
    FFSEG_APART
    for (int x = 0; x < count; ++x) {
        gx[x] = slope_x(rows, x);
        gy[x] = slope_y(rows, x);
    }
}

FFSEG_CLONES
void keep_steeper(ThreeRows smoothed, SlopeRow kept, int count) {
    const ThreeRows rows = smoothed;
    std::int16_t* __restrict gx = kept.gx;
    std::int16_t* __restrict gy = kept.gy;
    FFSEG_APART
    for (int x = 0; x < count; ++x) {
        const std::int16_t u = slope_x(rows, x), v = slope_y(rows, x), s = gx[x], t = gy[x];
        const bool steeper = u * u + v * v > s * s + t * t;
        gx[x] = steeper ? u : s;
        gy[x] = steeper ? v : t;
    }
}

FFSEG_CLONES
void gradient_row(ThreeRows smoothed, GradientRow out, int count) {
    const ThreeRows rows = smoothed;
    std::uint16_t* __restrict size = out.size;
    std::uint16_t* __restrict way = out.direction;
    FFSEG_APART
    for (int x = 0; x < count; ++x) {
        const std::int16_t gx = slope_x(rows, x), gy = slope_y(rows, x);
        size[x] = magnitude(gx, gy);
        way[x] = direction(gx, gy);
    }
}

FFSEG_CLONES
void gradient_row(SlopeRow slope, GradientRow out, int count) {
    const std::int16_t* __restrict gx = slope.gx;
    const std::int16_t* __restrict gy = slope.gy;
    std::uint16_t* __restrict size = out.size;
    std::uint16_t* __restrict way = out.direction;
    FFSEG_APART
    for (int x = 0; x < count; ++x) {
        size[x] = magnitude(gx[x], gy[x]);
        way[x] = direction(gx[x], gy[x]);
    }
}

FFSEG_CLONES
void ridge_row(ThreeRows gradient, const std::uint16_t* direction, std::uint8_t* ridges, int count) {
    const std::uint16_t* __restrict above = gradient.above;
    const std::uint16_t* __restrict here = gradient.here;
    const std::uint16_t* __restrict below = gradient.below;
    const std::uint16_t* __restrict way = direction;
    std::uint8_t* __restrict out = ridges;
    FFSEG_APART
    for (int x = 0; x < count; ++x) {
        const std::uint16_t a = above[x - 1], b = above[x], c = above[x + 1], d = here[x - 1], e = here[x + 1];
        const std::uint16_t f = below[x - 1], g = below[x], h = below[x + 1];
        const std::uint16_t lower = way[x] == kAcross ? d : way[x] == kDown ? b : way[x] == kFalling ? a : c;
        const std::uint16_t higher = way[x] == kAcross ? e : way[x] == kDown ? g : way[x] == kFalling ? h : f;
        out[x] = static_cast<std::uint8_t>((here[x] > lower) & (here[x] >= higher));
    }
}

}  // namespace ffseg::edges
