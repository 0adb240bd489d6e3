// Constant matrices of one Bezier degree: interpolation (Eq. 5, 6), derivatives at the samples, resampling.
#pragma once
#include <array>
#include <cstring>
#include <cstddef>

#include "common/lanes.hpp"
#include "common/vec.hpp"

namespace ffseg::freeform {

// A curve oscillates if its control polygon is longer than the polygon of its samples by this factor (quarter circle:
// 1.1).
constexpr double kOscillation = 1.25;

// A patch of degree D is known by its D + 1 samples M_k = B(k / D); every matrix below acts on them.
template <int D>
struct Basis {
    static constexpr int kSub = 8;  // positions per interval between two samples
    static constexpr int kReducedDegree = D <= 3 ? (D <= 2 ? 1 : 2) : 3;
    using Row = std::array<double, D + 1>;

    std::array<Row, D + 1> vandermonde{};            // V: samples from control points (Eq. 5)
    std::array<Row, D + 1> inverse{};                // V^-1: control points from samples (Eq. 6)
    std::array<Row, D + 1> slope{};                  // V' V^-1: derivatives at the samples
    std::array<std::array<Row, kSub>, D> between{};  // between[k][j]: the point at t = (k + j / kSub) / D
    std::array<std::array<Row, kSub>, D> between_slope{};
    // `between` with the positions side by side, and the step from each position to the next, in single precision: for
    // testing pixels.
    using Lanes = std::array<std::array<float, kSub>, D + 1>;
    std::array<Lanes, D> places{}, headings{}, strides{};
    std::array<Row, 2 * D + 1> halves{};             // the points at t = i / (2 D) (Alg. 2)
    std::array<Row, D + 1> reduced{};  // the samples of the least-squares curve of degree kReducedDegree
                                       // with the same ends

    constexpr Basis() {
        for (int k = 0; k <= D; ++k) vandermonde[k] = bernstein(static_cast<double>(k) / D);
        invert();
        for (int k = 0; k <= D; ++k) slope[k] = times_inverse(bernstein_slope(static_cast<double>(k) / D));
        for (int k = 0; k < D; ++k) {
            for (int j = 0; j < kSub; ++j) {
                const double t = (k + static_cast<double>(j) / kSub) / D, next = t + 1.0 / (kSub * D);
                const Row ahead = times_inverse(bernstein(next));
                between[k][j] = times_inverse(bernstein(t));
                between_slope[k][j] = times_inverse(bernstein_slope(t));
                for (int i = 0; i <= D; ++i) {
                    places[k][i][j] = static_cast<float>(between[k][j][i]);
                    headings[k][i][j] = static_cast<float>(between_slope[k][j][i]);
                    strides[k][i][j] = static_cast<float>(ahead[i] - between[k][j][i]);
                }
            }
        }
        fit_reduced();
        for (int i = 0; i <= 2 * D; ++i) halves[i] = times_inverse(bernstein(static_cast<double>(i) / (2 * D)));
    }

private:
    // Those of the standard library are not constexpr in C++17.
    static constexpr double size(double x) { return x < 0 ? -x : x; }
    static constexpr void exchange(Row& a, Row& b) {
        const Row kept = a;
        a = b;
        b = kept;
    }
    static constexpr double binomial(int n, int k) {
        double value = 1.0;
        for (int i = 0; i < k; ++i) value = value * (n - i) / (i + 1);
        return value;
    }
    static constexpr double power(double base, int exponent) {
        double value = 1.0;
        for (int i = 0; i < exponent; ++i) value *= base;
        return value;
    }
    static constexpr Row bernstein(double t) {
        Row row{};
        for (int i = 0; i <= D; ++i) row[i] = binomial(D, i) * power(t, i) * power(1.0 - t, D - i);
        return row;
    }
    static constexpr Row bernstein_slope(double t) {
        Row row{};
        for (int i = 0; i < D; ++i) {
            const double b = D * binomial(D - 1, i) * power(t, i) * power(1.0 - t, D - 1 - i);
            row[i] -= b;
            row[i + 1] += b;
        }
        return row;
    }
    constexpr Row times_inverse(const Row& row) const {
        Row out{};
        for (int i = 0; i <= D; ++i) {
            for (int j = 0; j <= D; ++j) out[j] += row[i] * inverse[i][j];
        }
        return out;
    }
    // The fit is chord + t (1 - t) q(t) with q of degree kReducedDegree - 2: zero (the chord), constant or linear.
    constexpr void fit_reduced() {
        double g00 = 0, g01 = 0, g11 = 0;
        const auto bump = [](int k) {
            const double t = static_cast<double>(k) / D;
            return t * (1.0 - t);
        };
        for (int k = 1; k < D; ++k) {
            const double a = bump(k), b = a * (2.0 * k / D - 1.0);
            g00 += a * a;
            g01 += a * b;
            g11 += b * b;
        }
        for (int k = 0; k <= D; ++k) {
            const double t = static_cast<double>(k) / D;
            reduced[k][0] = 1.0 - t;
            reduced[k][D] = t;
            if (kReducedDegree < 2) continue;
            const double a = bump(k), b = kReducedDegree > 2 ? a * (2.0 * t - 1.0) : 0.0;
            const double det = g00 * g11 - g01 * g01;
            const double wa = kReducedDegree > 2 ? (a * g11 - b * g01) / det : a / g00;
            const double wb = kReducedDegree > 2 ? (b * g00 - a * g01) / det : 0.0;
            for (int j = 1; j < D; ++j) {
                const double tj = static_cast<double>(j) / D;
                const double weight = wa * bump(j) + wb * bump(j) * (2.0 * tj - 1.0);
                reduced[k][j] += weight;
                reduced[k][0] -= weight * (1.0 - tj);
                reduced[k][D] -= weight * tj;
            }
        }
    }
    constexpr void invert() {  // Gauss-Jordan with pivoting; V of degree <= 6 has a condition number below 200
        auto a = vandermonde;
        for (int i = 0; i <= D; ++i) inverse[i][i] = 1.0;
        for (int col = 0; col <= D; ++col) {
            int pivot = col;
            for (int r = col + 1; r <= D; ++r) {
                if (size(a[r][col]) > size(a[pivot][col])) pivot = r;
            }
            exchange(a[col], a[pivot]);
            exchange(inverse[col], inverse[pivot]);
            const double scale = 1.0 / a[col][col];
            for (int j = 0; j <= D; ++j) {
                a[col][j] *= scale;
                inverse[col][j] *= scale;
            }
            for (int r = 0; r <= D; ++r) {
                const double factor = a[r][col];
                if (r == col || factor == 0.0) continue;
                for (int j = 0; j <= D; ++j) {
                    a[r][j] -= factor * a[col][j];
                    inverse[r][j] -= factor * inverse[col][j];
                }
            }
        }
    }
};

template <int D>
inline constexpr Basis<D> kBasis{};

// Samples or control points of a patch.
template <int D>
using Points = std::array<Vec2, D + 1>;

// A row of weights applied to D + 1 points.
template <int D>
inline Vec2 apply(const std::array<double, D + 1>& row, const std::array<Vec2, D + 1>& points) {
    Vec2 sum{row[0] * points[0].x, row[0] * points[0].y};
    for (int i = 1; i <= D; ++i) {
        sum.x += row[i] * points[i].x;
        sum.y += row[i] * points[i].y;
    }
    return sum;
}

// The samples of a patch in single precision, each repeated four times.
template <int D>
struct Spread {
    std::array<Float4, D + 1> x, y;

    FFSEG_INLINE explicit Spread(const Points<D>& points) {
        for (int i = 0; i <= D; ++i) {
            x[i] = all(static_cast<float>(points[i].x));
            y[i] = all(static_cast<float>(points[i].y));
        }
    }
};

// All points of one interval at once: weights applied to the samples of a patch.
template <int D>
struct Places {
    static constexpr int kFours = Basis<D>::kSub / 4;
    std::array<Float4, kFours> x, y;

    FFSEG_INLINE Places(const typename Basis<D>::Lanes& weights, const Spread<D>& points) {
        for (int i = 0; i <= D; ++i) {
            for (int q = 0; q < kFours; ++q) {
                Float4 weight;
                std::memcpy(&weight, &weights[i][4 * q], sizeof weight);
                x[q] = i == 0 ? weight * points.x[i] : x[q] + weight * points.x[i];
                y[q] = i == 0 ? weight * points.y[i] : y[q] + weight * points.y[i];
            }
        }
    }
};

}  // namespace ffseg::freeform
