// The region of closed contours on the grid of pixel centres.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/vec.hpp"
#include "raster/edges_of_curve.hpp"

namespace ffseg::raster {

struct MaskView {
    std::uint8_t* data;  // height rows of width bytes, C-contiguous
    int height, width;
};

// Sets 1 where the winding number of all edges together round the pixel centre is > 0, else 0.
// Half-open: an edge owns its end of smaller y; a centre on an edge counts as right of it. So a box [0, n] x [0, n]
// holds the centres 0..n-1 of both axes, and regions that share an edge share no pixel and leave none between them.
void fill_mask(const std::vector<Edge>& edges, const MaskView& mask);

// Columns begin..end - 1 of row y.
struct Span {
    int y, begin, end;
};

// The same pixels as `fill_mask` in rows and columns, as spans in order of row and column that do not touch.
// Costs the crossings of the edges with the rows, whatever lies between them.
std::vector<Span> fill_spans(const std::vector<Edge>& edges, int height, int width);

}  // namespace ffseg::raster
