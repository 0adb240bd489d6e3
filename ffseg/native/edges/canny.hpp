// Canny edges: the ridges of the gradient that are strong or connected to strong ones.
#pragma once
#include <cstdint>
#include <vector>

namespace ffseg::edges {

// Thresholds in stored units, one pair for every block of NoiseMap::kBlock pixels.
struct ThresholdMap {
    int columns = 0;
    std::vector<std::uint16_t> low, high;
};

// Turn ridges (1, else 0) into edges (255, else 0).
void link_edges(const std::uint16_t* gradient, int height, int width, const ThresholdMap& thresholds,
                std::uint8_t* edges);

}  // namespace ffseg::edges
