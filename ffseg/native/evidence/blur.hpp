// Gaussian smoothing of float planes; outside, the border repeats.
#pragma once
#include "evidence/plane.hpp"

namespace ffseg::evidence {

// Beyond it the kernel would be longer than any plane is wide.
constexpr double kWidestBlur = 64.0;

// Smooths `plane` into `out`; they may be the same. Cut at three standard deviations, the weights sum to 1.
void blur(const float* plane, Size size, double sigma, float* out);

}  // namespace ffseg::evidence
