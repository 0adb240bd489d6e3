// Distances between point sets.
#pragma once
#include <vector>

#include "common/vec.hpp"

namespace ffseg::measures {

// Distance of each point to the nearest of `others`, exact; infinite when there are none. Coordinates must be finite.
std::vector<double> nearest_distances(const std::vector<Vec2>& points, const std::vector<Vec2>& others);

}  // namespace ffseg::measures
