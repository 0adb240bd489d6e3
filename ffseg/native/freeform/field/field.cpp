#include "freeform/field/field.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>

#include "freeform/field/runs.hpp"

namespace ffseg::field {
namespace {

FFSEG_INLINE bool any_set(const std::uint8_t* bytes, int count) {
    Eight any = 0;
    if (count == kRun) {
        for (int at = 0; at < kRun; at += kEight) any |= eight(bytes + at);
        return any != 0;
    }
    int at = 0;
    for (; at + kEight <= count; at += kEight) any |= eight(bytes + at);
    for (; at < count; ++at) any |= bytes[at];
    return any != 0;
}

// kRun cells of one row from the edges (0 or 1) of this row and those above and below it: edge pixels and the band
// round them. A pixel under an edge pixel whose neighbour continues the edge diagonally becomes solid too, so that an
// edge is a 4-connected chain.
FFSEG_CLONES
void mark_run(const std::uint8_t* up, const std::uint8_t* mid, const std::uint8_t* down,
              std::uint8_t* __restrict cells) {
    for (int x = 0; x < kRun; x += kEight) {
        const Eight above = eight(up + x), here = eight(mid + x), below = eight(down + x);
        const Eight up_left = eight(up + x - 1), up_right = eight(up + x + 1);
        const Eight left = eight(mid + x - 1), right = eight(mid + x + 1);
        const Eight solid = here | (above & ((left & (up_left ^ kOnes)) | (right & (up_right ^ kOnes))));
        const Eight near =
            above | up_left | up_right | here | left | right | below | eight(down + x - 1) | eight(down + x + 1);
        const Eight marked = near | (solid + solid);
        std::memcpy(cells + x, &marked, sizeof marked);
    }
}

// out[c] = a[c] | b[c] | d[c]; the output overlaps none of them.
FFSEG_CLONES
void or_three(const std::uint8_t* a, const std::uint8_t* b, const std::uint8_t* d, std::uint8_t* __restrict out,
              std::size_t count) {
    for (std::size_t c = 0; c < count; ++c) out[c] = a[c] | b[c] | d[c];
}

FFSEG_CLONES
void add_where_zero(const std::uint8_t* marks, std::uint8_t gained, std::uint8_t* __restrict sums, std::size_t count) {
    for (std::size_t at = 0; at < count; ++at) {
        sums[at] = static_cast<std::uint8_t>(sums[at] + (marks[at] == 0 ? gained : 0));
    }
}

// A whole run as 0 and 1, and the tiles it lies in.
void read_run(const std::uint8_t* from, std::uint8_t* row, std::uint8_t* tiles) {
    constexpr int kTiles = kRun >> kTileShift;
    std::array<std::uint8_t, kRun> pixels;
    std::array<std::uint32_t, kTiles> words;
    std::array<std::uint8_t, kTiles> held;
    std::memcpy(pixels.data(), from, sizeof pixels);
    std::memcpy(words.data(), from, sizeof words);
    std::memcpy(held.data(), tiles, sizeof held);
    for (int x = 0; x < kRun; ++x) pixels[x] = pixels[x] != 0;
    for (int tile = 0; tile < kTiles; ++tile) held[tile] |= words[tile] != 0;
    std::memcpy(row, pixels.data(), sizeof pixels);
    std::memcpy(tiles, held.data(), sizeof held);
}

// A row of edges as 0 and 1, which of its runs hold any, and the tiles they lie in; beyond the image there are none.
// True if there are any at all.
bool read_row(const Cells& cells, const std::uint8_t* edges, int y, std::uint8_t* row, std::uint8_t* flags,
              std::vector<std::uint8_t>& occupied) {
    const int runs = (cells.width + kRun - 1) / kRun;
    const std::uint8_t* from = edges + static_cast<std::size_t>(y) * cells.width;
    std::uint8_t* tiles = occupied.data() + static_cast<std::size_t>(y >> kTileShift) * cells.tiles_x;
    bool found = false;
    for (int run = 0; run < runs; ++run) {
        const int first = run * kRun, count = y < cells.height ? std::min(kRun, cells.width - first) : 0;
        const bool any = any_set(from + first, count);
        if (!any && flags[run] == 0) continue;
        flags[run] = any;
        found = found || any;
        if (any && count == kRun) {
            read_run(from + first, row + first, tiles + (first >> kTileShift));
            continue;
        }
        std::memset(row + first, 0, kRun);
        if (!any) continue;
        for (int x = 0; x < count; ++x) row[first + x] = from[first + x] != 0;
        for (int tile = 0; tile << kTileShift < count; ++tile) {
            std::uint32_t word = 0;
            std::memcpy(&word, row + first + (tile << kTileShift), sizeof word);
            tiles[(first >> kTileShift) + tile] |= word != 0 ? 1 : 0;
        }
    }
    return found;
}

void mark_edges(Cells& cells, const std::uint8_t* edges, std::vector<std::uint8_t>& occupied, RunMarks& held) {
    static_assert(kBand == 1 && kEdge == 2, "mark_run writes these");
    const int runs = (cells.width + kRun - 1) / kRun;
    const std::size_t padded = static_cast<std::size_t>(runs + 2) * kRun;
    // Three rows of edges as 0 and 1, their runs that hold any, with margins of a run at either side.
    std::vector<std::uint8_t> rows(3 * padded), flags(4 * static_cast<std::size_t>(runs + 2)), part(kRun);
    std::array<std::uint8_t*, 3> row{}, flag{};
    for (std::size_t i = 0; i < 3; ++i) {
        row[i] = rows.data() + i * padded + kRun;
        flag[i] = flags.data() + i * static_cast<std::size_t>(runs + 2) + 1;
    }
    std::uint8_t* const near = flags.data() + 3 * static_cast<std::size_t>(runs + 2) + 1;
    std::array<bool, 3> filled{false, false, read_row(cells, edges, 0, row[2], flag[2], occupied)};
    for (int y = 0; y < cells.height; ++y) {
        std::rotate(row.begin(), row.begin() + 1, row.end());
        std::rotate(flag.begin(), flag.begin() + 1, flag.end());
        std::rotate(filled.begin(), filled.begin() + 1, filled.end());
        filled[2] = read_row(cells, edges, y + 1, row[2], flag[2], occupied);
        if (!(filled[0] || filled[1] || filled[2])) continue;
        for (int run = -1; run <= runs; ++run) near[run] = flag[0][run] | flag[1][run] | flag[2][run];
        for (int run = 0; run < runs; ++run) {
            if ((near[run - 1] | near[run] | near[run + 1]) == 0) continue;
            const std::size_t x = static_cast<std::size_t>(run) * kRun;
            const auto side = [&](std::ptrdiff_t at) { return row[0][at] | row[1][at] | row[2][at]; };
            const auto first = static_cast<std::ptrdiff_t>(x);
            // Only the runs beside may hold any, and those not at this side.
            if (near[run] == 0 && (side(first - 1) | side(first + kRun)) == 0) continue;
            held.row(y)[run] = 1;
            std::uint8_t* const to = &cells.blocked[cells.at(run * kRun, y)];
            const bool whole = (run + 1) * kRun <= cells.width;
            mark_run(row[0] + x, row[1] + x, row[2] + x, whole ? to : part.data());
            if (!whole) std::memcpy(to, part.data(), static_cast<std::size_t>(cells.width) - x);
        }
    }
}

void mark_outside(Cells& cells, const std::uint8_t* domain, std::vector<std::uint8_t>& occupied, RunMarks& held) {
    const std::size_t rows = static_cast<std::size_t>(cells.height) + 2;
    std::memset(cells.blocked.data(), kOutside, cells.stride);
    std::memset(cells.blocked.data() + (rows - 1) * cells.stride, kOutside, cells.stride);
    for (std::size_t y = 0; y < rows; ++y) {
        cells.blocked[y * cells.stride] = kOutside;
        cells.blocked[(y + 1) * cells.stride - 1] = kOutside;
    }
    if (domain == nullptr) return;
    for (int y = 0; y < cells.height; ++y) {
        for (int x = 0; x < cells.width; ++x) {
            if (domain[static_cast<std::size_t>(y) * cells.width + x] != 0) continue;
            cells.blocked[cells.at(x, y)] = kOutside;
            held.row(y)[x / kRun] = 1;
            occupied[static_cast<std::size_t>(y >> kTileShift) * cells.tiles_x +
                     static_cast<std::size_t>(x >> kTileShift)] = 1;
        }
    }
}

// Tiles grow by one all round, level by level; a tile not reached by level k has k free tiles on every side. Tiles at
// the border (the last row and column may be cut) have the outside beside them. The band round an edge may lie in the
// next tile, one pixel deep: what is free is one pixel less.
void measure_reach(Cells& cells, std::vector<std::uint8_t>& occupied) {
    const std::size_t columns = cells.tiles_x, rows = cells.tiles_y;
    for (const std::size_t r : {rows - 1, std::max<std::size_t>(rows, 2) - 2}) {
        std::memset(occupied.data() + r * columns, 1, columns);
    }
    for (const std::size_t c : {columns - 1, std::max<std::size_t>(columns, 2) - 2}) {
        for (std::size_t r = 0; r < rows; ++r) occupied[r * columns + c] = 1;
    }
    cells.reach.assign(rows * columns, 0);
    std::vector<std::uint8_t> grown(occupied.size());
    const std::size_t tiles = columns * rows;
    for (int level = 0; level < kLevels; ++level) {
        // Across and down, all rows in one go; what runs over from one row to the next lies at the border, which is
        // set.
        if (tiles > 2) or_three(occupied.data(), occupied.data() + 1, occupied.data() + 2, grown.data() + 1, tiles - 2);
        for (std::size_t r = 0; r < rows; ++r) grown[r * columns] = grown[(r + 1) * columns - 1] = 1;
        std::memset(occupied.data(), 1, columns);
        std::memset(occupied.data() + tiles - columns, 1, columns);
        if (rows > 2) {
            const std::uint8_t* in = grown.data() + columns;
            or_three(in - columns, in, in + columns, occupied.data() + columns, tiles - 2 * columns);
        }
        const std::uint8_t gained = level == 0 ? (1 << kTileShift) - 1 : 1 << kTileShift;
        add_where_zero(occupied.data(), gained, cells.reach.data(), cells.reach.size());
    }
}

}  // namespace

Cells::Cells(int h, int w, std::size_t padding)
    : height(h),
      width(w),
      stride(static_cast<std::size_t>(w) + 2),
      tiles_x(static_cast<std::size_t>((w - 1) >> kTileShift) + 1),
      tiles_y(static_cast<std::size_t>((h - 1) >> kTileShift) + 1),
      blocked((static_cast<std::size_t>(h) + 2) * stride + padding) {}

Field::Field(const std::uint8_t* edges, const std::uint8_t* domain, int height, int width)
    : cells_(height, width, kRun + 1) {
    std::vector<std::uint8_t> occupied(cells_.tiles_x * cells_.tiles_y);
    RunMarks held(height, static_cast<std::size_t>((width + kRun - 1) / kRun));
    mark_edges(cells_, edges, occupied, held);
    mark_outside(cells_, domain, occupied, held);
    measure_reach(cells_, occupied);
    shut_slits(cells_, held);
}

// Which tiles hold something blocked, from the pixels.
void build_tiles(Cells& cells) {
    constexpr int kTile = 1 << kTileShift;
    std::vector<std::uint8_t> occupied(cells.tiles_x * cells.tiles_y);
    for (int y = 0; y < cells.height; ++y) {
        std::uint8_t* const tiles = occupied.data() + static_cast<std::size_t>(y >> kTileShift) * cells.tiles_x;
        const std::uint8_t* const row = &cells.blocked[cells.at(0, y)];
        for (int x = 0; x < cells.width; x += kTile) {
            std::uint32_t word = 0;
            if (x + kTile <= cells.width) {
                std::memcpy(&word, row + x, sizeof word);
            } else {
                std::memcpy(&word, row + x, static_cast<std::size_t>(cells.width - x));
            }
            tiles[x >> kTileShift] |= word != 0 ? 1 : 0;
        }
    }
    measure_reach(cells, occupied);
}

// Is there a solid pixel in these columns and rows, both ends included?
bool holds_solid(const Cells& cells, int left, int right, int top, int bottom) {
    for (int tile_y = top >> kTileShift; tile_y <= bottom >> kTileShift; ++tile_y) {
        const int y0 = std::max(top, tile_y << kTileShift), y1 = std::min(bottom, ((tile_y + 1) << kTileShift) - 1);
        for (int tile_x = left >> kTileShift; tile_x <= right >> kTileShift; ++tile_x) {
            if (cells.reach[static_cast<std::size_t>(tile_y) * cells.tiles_x + static_cast<std::size_t>(tile_x)] != 0)
                continue;
            const int x0 = std::max(left, tile_x << kTileShift), x1 = std::min(right, ((tile_x + 1) << kTileShift) - 1);
            for (int y = y0; y <= y1; ++y) {
                for (int x = x0; x <= x1; ++x) {
                    if (Field::is_solid(cells.blocked[cells.at(x, y)])) return true;
                }
            }
        }
    }
    return false;
}

bool Field::encloses_solid(const Vec2* polygon, std::size_t count) const {
    Box box;
    for (std::size_t i = 0; i < count; ++i) box.add(clamp(polygon[i]));
    if (!holds_solid(box)) return false;
    const auto first = [](double from) { return static_cast<int>(std::ceil(from)); };
    const int top = first(box.y0), bottom = static_cast<int>(std::floor(box.y1));
    std::vector<std::pair<int, double>> crossings;  // of the polygon with the rows
    for (std::size_t i = 0, j = count - 1; i < count; j = i++) {
        const Vec2 a = polygon[i], b = polygon[j];
        const double low = std::min(a.y, b.y), high = std::max(a.y, b.y);
        for (int y = std::max(first(low), top); y <= bottom && y < high; ++y) {
            crossings.emplace_back(y, a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x));
        }
    }
    std::sort(crossings.begin(), crossings.end());
    for (std::size_t at = 0; at + 1 < crossings.size(); at += 2) {
        const auto& [y, from] = crossings[at];
        const int left = std::max(first(from), 0), right = std::min(first(crossings[at + 1].second), width()) - 1;
        if (left <= right && field::holds_solid(cells_, left, right, y, y)) return true;
    }
    return false;
}

}  // namespace ffseg::field
