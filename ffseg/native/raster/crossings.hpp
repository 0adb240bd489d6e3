// Where contours cross the steps between neighbouring pixel centres.
#pragma once
#include <vector>

#include "raster/edges_of_curve.hpp"

namespace ffseg::raster {

// A crossing counts for the steps on both sides of a centre that it is so near to, in parts of a step, and stays so far
// from it: outlines of neighbours then lie 0.028 px apart at least.
constexpr double kMargin = 0.02;

// Steps from a centre to the next along x, given by their middles, moved to where the edges cross them: to the mean,
// where several do; they stay, where none does. Steps along y stay.
void move_to_crossings(const std::vector<Edge>& edges, std::vector<Vec2>& steps);

}  // namespace ffseg::raster
