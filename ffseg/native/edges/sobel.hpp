// Slopes, gradient magnitude and ridges of rows of smoothed pixels. Rows of smoothed pixels and of gradients are read
// one pixel beyond both ends.
#pragma once
#include <cstdint>

namespace ffseg::edges {

// A smoothed row and its neighbours, in 1/32 grey level.
struct ThreeRows {
    const std::uint16_t *above, *here, *below;
};

// Sobel sums over 3x3 pixels: 8 times the slope in 1/32 grey level per pixel.
struct SlopeRow {
    std::int16_t *gx, *gy;
};

void slope_row(ThreeRows smoothed, SlopeRow out, int count);

// Keep, pixel by pixel, the steeper of two slopes; of equal ones that which is there.
void keep_steeper(ThreeRows smoothed, SlopeRow kept, int count);

// The neighbours between which a slope points, along Canny's four directions.
enum Direction : std::uint16_t { kAcross, kDown, kFalling, kRising };

// Gradient magnitude in 1/32 grey level per pixel, and the direction of the slope.
struct GradientRow {
    std::uint16_t *size, *direction;
};

void gradient_row(ThreeRows smoothed, GradientRow out, int count);
void gradient_row(SlopeRow slope, GradientRow out, int count);

// 1 where the gradient is a maximum along its direction, else 0. A tie keeps the pixel on the lower-index side, so that
// a ramp two pixels wide gives one edge.
void ridge_row(ThreeRows gradient, const std::uint16_t* direction, std::uint8_t* ridges, int count);

}  // namespace ffseg::edges
