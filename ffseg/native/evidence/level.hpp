// The level of a map of probability as edges and as a ridge of the gradient.
#pragma once
#include <cstdint>

#include "evidence/plane.hpp"

namespace ffseg::evidence {

struct LevelOptions {
    float undecided;     // edges of the image count where a value is nearer to the level than this
    float snap, width;   // px; standard deviations of the window of the image's gradient, and of the ridge
    float height;        // of the ridge, in units of the gradient
};

// `above` is the map less the level. In place: `gradient` keeps to where the map is undecided and near the level, where
// a ridge is added; `edges` (255) keep to where it is undecided, and gain the pixels below the level that have one
// above it beside them.
void level_edges(const float* above, Size size, const LevelOptions& options, std::uint16_t* gradient,
                 std::uint8_t* edges);

}  // namespace ffseg::evidence
