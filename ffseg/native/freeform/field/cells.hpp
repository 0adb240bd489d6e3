// The pixels of a field: what blocks each of them, and its distance to the nearest blocked one.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace ffseg::field {

// Cell states. Everything blocked has the lowest bit set: an edge pixel is kBand | kEdge.
constexpr std::uint8_t kBand = 1, kEdge = 2, kOutside = 5;
// A tile has 1 << kTileShift pixels a side.
constexpr int kTileShift = 2;
// Tiles up to which the distance to the nearest blocked one is stored.
constexpr int kLevels = 4;

struct Cells {
    Cells(int h, int w, std::size_t padding);

    std::size_t at(int x, int y) const {
        return (static_cast<std::size_t>(y) + 1) * stride + static_cast<std::size_t>(x) + 1;
    }

    int height, width;
    std::size_t stride, tiles_x, tiles_y;
    std::vector<std::uint8_t> blocked;  // (H + 2) x (W + 2), one ring of outside
    std::vector<std::uint8_t> reach;    // one for every tile, in pixels
};

// Is there a solid pixel in these columns and rows, both ends included?
bool holds_solid(const Cells& cells, int left, int right, int top, int bottom);
// Distances of free tiles to the nearest occupied one (with anything blocked). Occupied tiles grow by one on all sides,
// level by level; a tile not reached by level k has k free tiles on every side. Beyond the tiles at the border (the
// last row and column may be cut) lies the outside. The band of an edge may reach one pixel into the next tile, so the
// free distance is one pixel less.
void measure_reach(Cells& cells, std::vector<std::uint8_t>& occupied);

}  // namespace ffseg::field
