// A reduced image in CIE L*a*b*.
#pragma once
#include <cstdint>

#include "evidence/plane.hpp"

namespace ffseg::evidence {

// An image of 8-bit grey (one channel) or BGR (three or four channels, the fourth is left out).
struct Pixels {
    const std::uint8_t* data;
    int height, width, channels;
};

// Size of an image of which every `factor` x `factor` pixels become one; those at the far borders may be smaller.
Size reduced(const Pixels& image, int factor);

// Mean colour of each block of pixels as L, a, b (D65, L from 0 to 100), three planes one after the other.
void reduced_lab(const Pixels& image, int factor, float* lab);

}  // namespace ffseg::evidence
