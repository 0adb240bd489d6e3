// How hard it is to get from the start region to each pixel.
#pragma once
#include <cstdint>

#include "evidence/plane.hpp"

namespace ffseg::evidence {

// Heights are counted in steps up to this many; what is higher counts as this high.
constexpr int kMaxLevel = 4095;

// The nearest whole number of steps, from 0 to `kMaxLevel`.
std::vector<std::uint16_t> stepped(const float* heights, std::size_t count, double step);

// What the barrier says of the region that it lets pass. The barrier is the smallest possible maximum of `heights`
// along a path between the four-connected pixels from the start region (nonzero in `inside`, whose own heights do not
// count) to each pixel. One plane after the other: the barrier in steps of `step`; its logarithm over the median height
// inside the start region; the share of pixels with a barrier as low or lower; the share of those with the same
// barrier; the share of those in the same class of its logarithm, ten classes a factor of e.
constexpr int kBarrierPlanes = 5;

void barrier_planes(const float* heights, const std::uint8_t* inside, Size size, double step, float* out);

// Length of the shortest path from the start region through pixels that cost `heights + least` each, both in steps of
// `step`; along diagonals a step is 7/5 long.
void geodesic(const float* heights, const std::uint8_t* inside, Size size, double step, int least, float* out);

}  // namespace ffseg::evidence
