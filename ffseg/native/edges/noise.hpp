// The noise of an image, read off its gradients.
#pragma once
#include <cstdint>
#include <vector>

namespace ffseg::edges {

// The median of a window of kNoiseWindow pixels round every block of kBlock.
// Windows in which less than an eighth of the pixels lie in the domain take that of the quiet ones.
struct NoiseMap {
    static constexpr int kBlock = 16, kNoiseWindow = 64;
    int rows = 0, columns = 0;
    std::uint16_t quiet = 0;            // a quarter of the windows have a lower median: noise without texture
    std::vector<std::uint16_t> blocks;  // rows x columns
};
NoiseMap noise_map(const std::uint16_t* gradient, const std::uint8_t* domain, int height, int width);

}  // namespace ffseg::edges
