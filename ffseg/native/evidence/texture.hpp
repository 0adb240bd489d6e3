// What a pixel looks like at one scale, whatever the start.
#pragma once
#include "evidence/plane.hpp"

namespace ffseg::evidence {

// The planes of one scale, one after the other: L, a, b smoothed; size of the gradient of L, of a and b together, and
// of all three; eigenvalues of the structure tensor of L (smoothed by twice the scale), the larger first. Slopes are
// 3x3 Sobel sums over 8; outside, the border repeats.
constexpr int kTexturePlanes = 8;

void texture(const float* lab, Size size, double sigma, float* out);

// Four of them only: L, a, b smoothed, and the size of the gradient of all three.
constexpr int kColourPlanes = 4;

void colour(const float* lab, Size size, double sigma, float* out);

}  // namespace ffseg::evidence
