// Gaussian smoothing of rows in 16-bit fixed point.
#pragma once
#include <cstdint>
#include <vector>

namespace ffseg::edges {

// A smoothed pixel in 1/32 grey level: 255 * 32 = 8160, so that a Sobel sum, at most 4 * 8160, fits 16 bits.
constexpr int kSmoothedBits = 5;

// A pixel between the two passes in 1/128 grey level: the sum of two, at most 65280, fits 16 bits.
constexpr int kAcrossBits = 7;

// Beyond it the rounding terms of the two passes could carry a smoothed pixel over 32767 / 4.
constexpr double kMaxSigma = 32.0;

// Weights of a Gaussian for the sums of two pixels k to the left and k to the right, in 1/65536; the first is for twice
// the pixel itself. Together they are one half exactly, so that a plain surface stays as it is.
struct Gaussian {
    std::vector<std::uint16_t> weights;
    int radius() const { return static_cast<int>(weights.size()) - 1; }
};

// Cut where the largest step, 255 grey levels, loses less than 1/32 grey level per pixel of its gradient.
Gaussian gaussian(double sigma);

// A row of pixels in 1/128 grey level; `step` channels lie side by side.
void widen_row(const std::uint8_t* row, int step, std::uint16_t* out, int width);

// Smooth a row to both sides, from `row[-radius]` to `row[count - 1 + radius]`.
void smooth_across(const std::uint16_t* row, const Gaussian& kernel, std::uint16_t* out, int count);

// Smooth over rows: `above[k]` and `below[k]` are those k rows up and down; `sums` holds what does not fit one pass.
// The result is in 1/32 grey level.
void smooth_down(const std::uint16_t* const* above, const std::uint16_t* const* below, const Gaussian& kernel,
                 std::uint16_t* out, int count);

}  // namespace ffseg::edges
