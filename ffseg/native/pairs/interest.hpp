// Interest points of one component: Harris corners, and samples of its edges.
#pragma once
#include <cstdint>
#include <vector>

#include "common/vec.hpp"
#include "pairs/patches.hpp"

namespace ffseg::pairs {

// A window of the image and which of its pixels belong to the component.
struct ComponentWindow {
    int x = 0, y = 0, width = 0, height = 0;
    std::vector<std::uint8_t> mask;

    bool holds(int column, int row) const { return mask[static_cast<std::size_t>(row) * width + column] != 0; }
};

// The region grown by a square of `by` pixels on every side, cut at the image border.
ComponentWindow grown(const ComponentWindow& region, int by, int image_width, int image_height);

// Corners of the region, strongest first and at most `most`: peaks of the Harris response, to a part of a pixel.
std::vector<Vec2> harris_points(const Picture& image, const ComponentWindow& region, int most);

// Pixels of strongest gradient in the region, at most one per cell and `most` in all, evenly thinned.
std::vector<Vec2> outline_points(const Picture& image, const ComponentWindow& region, int most);

}  // namespace ffseg::pairs
