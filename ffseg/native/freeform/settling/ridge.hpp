// Search for the ridge of the gradient along a line.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "common/lanes.hpp"
#include "common/vec.hpp"
#include "freeform/evolution.hpp"

namespace ffseg::settling {

using freeform::GradientView;

// Pixels between samples of the gradient along a normal; the peak is refined by a parabola.
constexpr double kRidgeStep = 0.5;

class Ridge {
public:
    Ridge(const GradientView& gradient, double low)
        : gradient_(gradient.data),
          low_(low),
          right_most_(gradient.width - 1.0),
          lowest_(gradient.height - 1.0),
          last_column_(std::max(gradient.width - 2, 0)),
          last_row_(std::max(gradient.height - 2, 0)),
          width_(gradient.width),
          right_(gradient.width > 1 ? 1 : 0),
          down_(gradient.height > 1 ? gradient.width : 0) {}

    // Bilinear; outside the image as at its border.
    FFSEG_INLINE double value(Vec2 p) const {
        const double x = std::min(std::max(p.x, 0.0), right_most_), y = std::min(std::max(p.y, 0.0), lowest_);
        return between(x, y, std::min(static_cast<int>(x), last_column_), std::min(static_cast<int>(y), last_row_));
    }

    // Prefetches the gradient round p.
    void announce(Vec2 p) const {
        const int column = std::clamp(static_cast<int>(p.x), 0, last_column_), row = static_cast<int>(p.y);
        for (int near = row - 1; near <= row + 2; ++near) {
            FFSEG_PREFETCH(gradient_ + std::clamp(near, 0, last_row_) * width_ + column);
        }
    }

    // Signed distance from p along `normal` to the ridge uphill from `from`, if it lies within [least, most]; else NaN.
    double climb(Vec2 p, Vec2 normal, double from, double least, double most) const {
        const double reach = std::max({most, -least, std::abs(from)}) + 2 * kRidgeStep;
        const bool inside = p.x >= reach && p.y >= reach && p.x + reach < right_most_ && p.y + reach < lowest_;
        if (!inside) return climb(from, least, most, [&](double s) FFSEG_PART { return value(p + s * normal); });
        return climb(from, least, most, [&](double s) FFSEG_PART {
            const Vec2 at = p + s * normal;
            return between(at.x, at.y, static_cast<int>(at.x), static_cast<int>(at.y));
        });
    }

private:
    FFSEG_INLINE double between(double x, double y, int column, int row) const {
        const std::uint16_t* at = gradient_ + row * width_ + column;
        const std::uint16_t* below = at + down_;
        const double u = x - column, v = y - row;
        const int first = at[0], second = below[0];
        const double top = first + u * (at[right_] - first), bottom = second + u * (below[right_] - second);
        return top + v * (bottom - top);
    }

    template <typename Profile>
    FFSEG_INLINE double climb(double from, double least, double most, Profile height) const {
        double a = height(from - kRidgeStep), b = height(from), c = height(from + kRidgeStep), s = from;
        while (c > b && c >= a) {
            s += kRidgeStep;
            if (s > most) return std::numeric_limits<double>::quiet_NaN();
            a = b;
            b = c;
            c = height(s + kRidgeStep);
        }
        while (a > b) {
            s -= kRidgeStep;
            if (s < least) return std::numeric_limits<double>::quiet_NaN();
            c = b;
            b = a;
            a = height(s - kRidgeStep);
        }
        if (b < low_) return std::numeric_limits<double>::quiet_NaN();
        const double bend = a - 2 * b + c;
        return bend < 0 ? s + kRidgeStep * 0.5 * (a - c) / bend : s;
    }

    const std::uint16_t* gradient_;
    double low_, right_most_, lowest_;
    int last_column_, last_row_;
    std::ptrdiff_t width_, right_, down_;
};

}  // namespace ffseg::settling
