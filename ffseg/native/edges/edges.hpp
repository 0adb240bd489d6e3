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

// The noise of an image, from its gradients: the median of a window of kNoiseWindow pixels round every block of kBlock.
// Windows in which less than an eighth of the pixels lie in the domain take that of the quiet ones.
struct NoiseMap {
    static constexpr int kBlock = 16, kNoiseWindow = 64;
    int rows = 0, columns = 0;
    std::uint16_t quiet = 0;            // a quarter of the windows have a lower median: noise without texture
    std::vector<std::uint16_t> blocks;  // rows x columns
};
NoiseMap noise_map(const std::uint16_t* gradient, const std::uint8_t* domain, int height, int width);

// Thresholds in stored units, one pair for every block of NoiseMap::kBlock pixels.
struct ThresholdMap {
    int columns = 0;
    std::vector<std::uint16_t> low, high;
};

// Canny: non-maximum suppression along the gradient and hysteresis; 255 on edges, 0 elsewhere.
void canny(const GreyView& image, const std::uint16_t* gradient, const ThresholdMap& thresholds, std::uint8_t* out);

}  // namespace ffseg
