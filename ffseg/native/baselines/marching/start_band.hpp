// Distances from the nodes just outside a start contour to it: start times of the narrow band, exact to sub-pixels.
#pragma once
#include <vector>

#include "baselines/marching/march.hpp"
#include "common/vec.hpp"

namespace ffseg::marching {

// Nodes outside (zero in `inside`) that have an inner 4-neighbour, each with its distance to the closed polygons in
// pixels, in raster order. `offsets` holds one entry more than there are polygons.
std::vector<Arrival> start_band(const Grid& grid, const std::uint8_t* inside, const std::vector<Vec2>& points,
                                const std::vector<std::size_t>& offsets);

}  // namespace ffseg::marching
