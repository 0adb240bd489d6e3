// Gradient magnitude of the smoothed image and its ridges, in one pass over the pixels.
#pragma once
#include <cstddef>
#include <cstdint>

#include "common/picture.hpp"
#include "edges/smooth.hpp"

namespace ffseg::edges {

// |grad (G * I)| of the strongest channel: Sobel 3x3, replicated border, in 1/32 grey level per pixel; largest is
// 255 / 2 * sqrt(2) * 32 < 2^13. `ridges` is 1 where it is a maximum along its direction and 0 elsewhere.
void gradient_and_ridges(const Picture& image, const Gaussian& kernel, std::uint16_t* gradient, std::uint8_t* ridges);

}  // namespace ffseg::edges
