// Straight edges that stand for Bezier patches on a grid of pixel centres.
#pragma once
#include <cstddef>
#include <vector>

#include "common/vec.hpp"

namespace ffseg::raster {

constexpr int kMaxDegree = 6;

// A piece of contour that crosses rows: low.y < high.y; sign +1 when the contour runs from low to high.
struct Edge {
    Vec2 low, high;
    int sign;
};

// The pixel centres (first..right, first..bottom) and how far an edge may leave its curve.
struct PixelGrid {
    double right, bottom;
    double tolerance;
    double first = 0.0;
};

// Appends the edges of a closed contour of `count` control points (Definition 1: the last patch wraps to the first
// point). Pieces that no row of centres can see are dropped; pieces left of all centres are replaced by their chord,
// which crosses the same rows with the same sum of signs.
void append_contour(const Vec2* points, std::size_t count, int degree, const PixelGrid& grid, std::vector<Edge>& edges);

}  // namespace ffseg::raster
