// Smoothing of float planes: Gaussian, where outside the border repeats, and such that stops at edges of the image.
#pragma once
#include "evidence/plane.hpp"

namespace ffseg::evidence {

// Beyond it the kernel would be longer than any plane is wide.
constexpr double kMaxBlur = 64.0;

// Smooths `plane` into `out`; they may be the same. Cut at three standard deviations, the weights sum to 1.
void blur(const float* plane, Size size, double sigma, float* out);

struct Diffusion {
    double kept;      // weight of a pixel's own value beside its four neighbours, each at most 1
    double contrast;  // difference of L, a, b at which a neighbour's weight has fallen to exp(-1/2)
    int steps;        // of Jacobi's method
};

// Brings `values` near the minimum of kept (u - values)^2 + sum of w (u - u')^2 over neighbours, where w falls with the
// difference of their colours: the energy of Grady's random walker with priors (PAMI 2006, eq. 3; CVPR 2005, eq. 6).
void diffuse(const float* values, const float* lab, Size size, const Diffusion& how, float* out);

}  // namespace ffseg::evidence
