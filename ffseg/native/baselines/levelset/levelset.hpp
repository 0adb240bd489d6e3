// The fast-marching level set (LS): march on a gradient map, climb its edges, trace the outline.
#pragma once
#include <cstdint>
#include <vector>

#include "baselines/marching/march.hpp"
#include "common/vec.hpp"

namespace ffseg::levelset {

struct LevelSetInput {
    marching::Grid grid;
    const std::uint16_t* gradient;  // (H, W)
    const double* slowness;         // one per gradient level, 65536; infinite from `stop` on
    const std::uint8_t* inside;     // (H, W), start region
    const std::uint8_t* domain;     // (H, W) or null
    int stop;                       // gradient level of an edge
    int reach;                      // nodes the front climbs an edge
    bool closing_in;  // `inside` is all but the start region; the result is what the front did not reach
    double min_area;  // outlines that enclose less (px^2) are dropped
};

struct LevelSetResult {
    std::vector<Vec2> points;
    std::vector<std::size_t> offsets{0};
    std::size_t accepted = 0, initial_band = 0, on_contour = 0;
};

LevelSetResult level_set(const LevelSetInput& input);

}  // namespace ffseg::levelset
