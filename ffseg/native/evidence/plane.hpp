// Planes of float32 features, one value a pixel, row by row.
#pragma once
#include <cstddef>
#include <vector>

#include "common/picture.hpp"

namespace ffseg::evidence {

using Plane = std::vector<float>;

// Whether no value is larger than `most`, below zero or above it, or no number.
bool within(const float* values, std::size_t count, float most);

// Rows and columns of every second pixel.
inline Size halved(Size size) { return {(size.height + 1) / 2, (size.width + 1) / 2}; }

// Every second pixel each way, the first among them.
void thin(const float* plane, Size size, float* out);

// The largest of each two by two pixels; those at the far borders may be fewer.
void steepest(const float* plane, Size size, float* out);

// A plane whose values are `stride` blocks of `factor` pixels apart, from the middle of the first block on, at each
// pixel: linear between them, and as at the border beyond.
struct Enlargement {
    Size size;  // of what is written
    int factor, stride;
};

void enlarge(const float* plane, Size size, const Enlargement& how, float* out);

}  // namespace ffseg::evidence
