// Gradient magnitude and Canny edges of a smoothed 8-bit image.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace ffseg {

// Units of a stored gradient per grey level and pixel; 180.4 (the largest 3x3 Sobel gradient) * 32 < 2^16.
constexpr float kGradientScale = 32.0f;

struct GreyView {
    const std::uint8_t* data;  // rows of width * channels bytes, C-contiguous
    int height, width, channels;
};

// |grad| of the strongest channel, Sobel 3x3, replicated border, in 1/32 grey level per pixel.
void gradient_magnitude(const GreyView& image, std::uint16_t* out);

// Value at the given quantile of a subsample of the gradients (every `stride`-th row), optionally inside `domain`.
std::uint16_t gradient_quantile(const std::uint16_t* gradient, const std::uint8_t* domain, int height, int width,
                                int stride, double quantile);

// Canny: non-maximum suppression along the gradient and hysteresis; 255 on edges, 0 elsewhere.
void canny(const GreyView& image, const std::uint16_t* gradient, std::uint16_t low, std::uint16_t high,
           std::uint8_t* out);

}  // namespace ffseg
