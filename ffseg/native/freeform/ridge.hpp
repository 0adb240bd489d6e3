// The ridge of the gradient, looked for along a line.
#pragma once
#include <array>
#include <cmath>
#include <limits>

#include "common/vec.hpp"
#include "freeform/evolution.hpp"

namespace ffseg {

// The search looks at the gradient every half pixel and refines the peak by a parabola.
constexpr double kRidgeStep = 0.5;
// A peak lower than this part of the highest in reach is noise on its flank.
constexpr double kRidgeShare = 0.5;
class Ridge {
public:
    Ridge(const GradientView& gradient, double low) : view_(gradient), low_(low) {}

    FFSEG_INLINE double value(Vec2 p) const {
        const double x = std::min(std::max(p.x, 0.0), view_.width - 1.0);
        const double y = std::min(std::max(p.y, 0.0), view_.height - 1.0);
        const int column = std::min(static_cast<int>(x), std::max(view_.width - 2, 0));
        const int row = std::min(static_cast<int>(y), std::max(view_.height - 2, 0));
        const int right = view_.width > 1 ? 1 : 0, down = view_.height > 1 ? view_.width : 0;
        const std::uint16_t* at = view_.data + static_cast<std::ptrdiff_t>(row) * view_.width + column;
        const double u = x - column, v = y - row;
        const double top = at[0] + u * (at[right] - at[0]), bottom = at[down] + u * (at[down + right] - at[down]);
        return top + v * (bottom - top);
    }

    // Signed distance from p along `normal` to the peak nearest to `expected` in [from, to]; NaN without a peak.
    double offset(Vec2 p, Vec2 normal, double from, double to, double expected) const {
        constexpr int kMost = 64;
        std::array<double, kMost> profile;
        const int count = std::min(kMost, static_cast<int>((to - from) / kRidgeStep) + 3);
        const double start = from - kRidgeStep;
        double highest = 0.0;
        for (int j = 0; j < count; ++j) {
            profile[static_cast<std::size_t>(j)] = value(p + (start + j * kRidgeStep) * normal);
            if (j > 0 && j + 1 < count) highest = std::max(highest, profile[static_cast<std::size_t>(j)]);
        }
        const double floor = std::max(low_, kRidgeShare * highest);
        double best = std::numeric_limits<double>::quiet_NaN();
        for (int j = 1; j + 1 < count; ++j) {
            const double a = profile[static_cast<std::size_t>(j - 1)], b = profile[static_cast<std::size_t>(j)],
                         c = profile[static_cast<std::size_t>(j + 1)];
            if (b < floor || b < a || b <= c) continue;
            const double peak = start + kRidgeStep * (j + 0.5 * (a - c) / (a - 2 * b + c));
            if (!(std::abs(peak - expected) >= std::abs(best - expected))) best = peak;
        }
        return best;
    }

    // The same, uphill from `from`: the ridge on whose slope a point stands, if it lies within [least, most].
    double climb(Vec2 p, Vec2 normal, double from, double least, double most) const {
        double a = value(p + (from - kRidgeStep) * normal), b = value(p + from * normal);
        double c = value(p + (from + kRidgeStep) * normal);
        double s = from;
        while (c > b && c >= a) {
            s += kRidgeStep;
            if (s > most) return std::numeric_limits<double>::quiet_NaN();
            a = b;
            b = c;
            c = value(p + (s + kRidgeStep) * normal);
        }
        while (a > b) {
            s -= kRidgeStep;
            if (s < least) return std::numeric_limits<double>::quiet_NaN();
            c = b;
            b = a;
            a = value(p + (s - kRidgeStep) * normal);
        }
        if (b < low_) return std::numeric_limits<double>::quiet_NaN();
        const double bend = a - 2 * b + c;
        return bend < 0 ? s + kRidgeStep * 0.5 * (a - c) / bend : s;
    }

private:
    GradientView view_;
    double low_;
};

}  // namespace ffseg
