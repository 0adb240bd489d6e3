// A reduced image in CIE L*a*b*.
#pragma once
#include <cstdint>

#include "evidence/plane.hpp"

namespace ffseg::evidence {

// Size of an image of which every `factor` x `factor` pixels become one; those at the far borders may be smaller.
Size reduced(const Picture& image, int factor);

// Mean colour of each block of pixels, grey (one channel) or BGR (three or four, the fourth is left out), as L, a, b
// (D65, L from 0 to 100), three planes one after the other.
void reduced_lab(const Picture& image, int factor, float* lab);

}  // namespace ffseg::evidence
