// Area and length of closed contours of Bezier patches.
#pragma once
#include <cmath>
#include <cstddef>
#include <vector>

#include "common/vec.hpp"

namespace ffseg {

// The sum in halves, so that its rounding error does not grow with the count; in the order that NumPy sums in.
inline double pairwise_sum(const double* values, std::size_t count) {
    if (count > 128) {
        const std::size_t half = count / 2 - count / 2 % 8;
        return pairwise_sum(values, half) + pairwise_sum(values + half, count - half);
    }
    double lanes[8] = {}, sum = 0.0;
    std::size_t at = 0;
    if (count >= 8) {
        for (; at < count - count % 8; ++at) lanes[at % 8] += values[at];
        sum = ((lanes[0] + lanes[1]) + (lanes[2] + lanes[3])) + ((lanes[4] + lanes[5]) + (lanes[6] + lanes[7]));
    }
    for (; at < count; ++at) sum += values[at];
    return sum;
}

// Signed area of a contour of `count` control points, the first of which is subtracted first. `matrix`, (degree + 1)
// squared values, takes the coordinates of a patch, x^T matrix y, to its integral of (x dy - y dx) / 2.
inline double signed_area(const Vec2* points, std::size_t count, const double* matrix, std::size_t degree) {
    std::vector<double> terms, x(degree + 1), y(degree + 1);
    terms.reserve(count + count / degree);
    for (std::size_t begin = 0; begin < count; begin += degree) {
        for (std::size_t k = 0; k <= degree; ++k) {
            const Vec2 point = points[begin + k < count ? begin + k : 0] - points[0];
            x[k] = point.x;
            y[k] = point.y;
        }
        for (std::size_t row = 0; row <= degree; ++row) {
            double moment = matrix[row] * x[0];
            for (std::size_t k = 1; k <= degree; ++k) moment += matrix[k * (degree + 1) + row] * x[k];
            terms.push_back(moment * y[row]);
        }
    }
    return pairwise_sum(terms.data(), terms.size());
}

// Length of the control polygon along the axes: no curve exceeds it.
inline double steps_along_axes(const Vec2* points, std::size_t count) {
    double steps = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec2 step = points[i + 1 < count ? i + 1 : 0] - points[i];
        steps += std::abs(step.x) + std::abs(step.y);
    }
    return steps;
}

}  // namespace ffseg
