// Coordinates as the text of an SVG path.
#pragma once
#include <string>
#include <vector>

#include "common/vec.hpp"

namespace ffseg::text {

// Larger coordinates are not exact in ten-thousandths.
constexpr double kMaxWritten = 1e11;

// Appends a coordinate with at most four digits behind the point, without trailing zeros and never as -0, correctly
// rounded (ties to even, as Python's "%.4f"). |value| <= kMaxWritten.
void append_number(double value, std::string& text);

// The closed contour of control points (Definition 1) of degree 1, 2 or 3 as M, then L, Q or C commands, then Z.
std::string path_text(const std::vector<Vec2>& points, int degree);

}  // namespace ffseg::text
