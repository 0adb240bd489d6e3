// What lies under the joints of contours: the image's gradient, or the border of the image or the domain.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/picture.hpp"
#include "common/vec.hpp"

namespace ffseg::edges {

// Where no edge is looked for: within `margin` pixels of the border of the image, or of a pixel outside the domain.
struct Limits {
    const std::uint8_t* domain;  // nonzero inside; or null: everywhere
    int height, width, margin;
};

// The largest of the nine gradients at each joint, those within the limits left out.
std::vector<std::uint16_t> gradients_at(const std::vector<Vec2>& joints, const std::uint16_t* gradient,
                                        const Limits& limits);

// Part of the length of the polygons through the joints, each from ends[k] to ends[k + 1], that lies within the limits.
double share_within(const std::vector<Vec2>& joints, const std::vector<std::size_t>& ends, const Limits& limits);

// Part of a region, on every `step`-th row, where the gradient is above the level for the squared distance to the
// nearest pixel outside: levels[n] for n pixels squared, falling; the last one holds farther inside, and nothing at
// distance 1. Beyond the image lies nothing. 1 as soon as it is more than `most`.
struct Lively {
    const double* levels;
    std::size_t count;
    int step;
    double most;
};
double lively_share(const std::uint8_t* region, const std::uint16_t* gradient, Size size, const Lively& asked);

}  // namespace ffseg::edges
