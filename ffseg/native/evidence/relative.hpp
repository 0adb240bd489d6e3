// Colour seen from the start region.
#pragma once
#include <cstdint>

#include "evidence/plane.hpp"

namespace ffseg::evidence {

// L, a, b of some pixels less their means inside the start region of the image, and the length of the three over
// (deviation inside + `floor`).
constexpr int kRelativePlanes = 4;

struct Pixels {
    const float* lab;
    std::size_t count;
};

void relative_colour(const float* lab, const std::uint8_t* inside, Size size, double floor, const Pixels& some,
                     float* out);

// How much likelier the colour of a pixel is in the start region than in the whole plane: the logarithm of the ratio of
// two smoothed histograms of 24 x 20 x 20 colours.
void likelihood_ratio(const float* lab, const std::uint8_t* inside, Size size, float* out);

}  // namespace ffseg::evidence
