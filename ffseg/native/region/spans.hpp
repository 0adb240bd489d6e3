// Sets of pixels as spans of rows: the complement, and what lies within a disc of them.
#pragma once
#include <vector>

#include "raster/raster.hpp"

namespace ffseg::region {

using raster::Span;

// Spans in order of row and column that do not touch: a set of pixels of an image.
using Spans = std::vector<Span>;

// The pixels of the image that are not in the set.
Spans complement(const Spans& spans, int height, int width);

// The pixels of `other` no farther than `radius` from the centre of a pixel of `spans`.
// Costs the spans times the rows of the disc.
Spans near(const Spans& spans, const Spans& other, double radius, int height, int width);

}  // namespace ffseg::region
