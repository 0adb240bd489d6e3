#include "freeform/field/field.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>

#include "common/lanes.hpp"

namespace ffseg::field {
namespace {

// Pixels of a row that are processed together.
constexpr int kRun = 64;

// Eight pixels, a byte each, as one number.
using Eight = std::uint64_t;
constexpr int kEight = 8;
constexpr Eight kOnes = 0x0101010101010101;

FFSEG_INLINE Eight eight(const std::uint8_t* bytes) {
    Eight read = 0;
    std::memcpy(&read, bytes, sizeof read);
    return read;
}

FFSEG_INLINE bool any_set(const std::uint8_t* run) {
    Eight any = 0;
    for (int at = 0; at < kRun; at += kEight) any |= eight(run + at);
    return any != 0;
}

// Rows of numbers, padded with zeros on all sides.
class Rows {
public:
    Rows(int height, int width, int margin)
        : margin_(margin),
          stride_(static_cast<std::size_t>(width + 2 * margin)),
          data_((static_cast<std::size_t>(height) + 2) * stride_) {}
    std::uint8_t* operator[](int y) { return &data_[static_cast<std::size_t>(y + 1) * stride_ + margin_]; }

private:
    int margin_;
    std::size_t stride_;
    std::vector<std::uint8_t> data_;
};

// The states of kRun pixels of a row, from the edges (0 or 1) of this row and its neighbours: edge pixels and their
// band. A pixel below an edge pixel whose neighbour continues the edge diagonally becomes solid, too, so that edges are
// 4-connected chains.
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

// A run as 0 and 1, and the tiles it lies in.
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

// A row of edges as 0 and 1, which of its runs hold any, and the tiles they lie in.
void read_row(const std::uint8_t* from, int width, std::uint8_t* row, std::uint8_t* flags, std::uint8_t* tiles) {
    for (int first = 0; first < width; first += kRun) {
        std::array<std::uint8_t, kRun> part{};
        const std::uint8_t* run = from + first;
        if (first + kRun > width) {
            std::memcpy(part.data(), run, static_cast<std::size_t>(width - first));
            run = part.data();
        }
        std::uint8_t& flag = flags[first / kRun];
        const bool any = any_set(run);
        if (any || flag != 0) read_run(run, row + first, tiles + (first >> kTileShift));
        flag = any;
    }
}

// Marks the edges and their band; `held` are the runs that contain any. Values written beyond the end of a row are
// overwritten with the next row.
void mark_edges(Cells& cells, const std::uint8_t* edges, std::vector<std::uint8_t>& occupied, Rows& held) {
    static_assert(kBand == 1 && kEdge == 2, "mark_run writes these");
    const int runs = (cells.width + kRun - 1) / kRun;
    const std::vector<std::uint8_t> none(static_cast<std::size_t>(cells.width));
    Rows rows(3, runs * kRun, kRun), flags(4, runs, 1);
    std::uint8_t* const near = flags[3];  // runs with any in three rows
    for (int y = 0; y <= cells.height; ++y) {
        const bool inside = y < cells.height;
        read_row(inside ? edges + static_cast<std::size_t>(y) * cells.width : none.data(), cells.width, rows[y % 3],
                 flags[y % 3], &occupied[static_cast<std::size_t>(y >> kTileShift) * cells.tiles_x]);
        if (y == 0) continue;
        for (int run = 0; run < runs; ++run) near[run] = flags[0][run] | flags[1][run] | flags[2][run];
        const std::uint8_t *const up = rows[(y + 1) % 3], *const here = rows[(y + 2) % 3], *const down = rows[y % 3];
        const auto column = [&](int x) { return up[x] | here[x] | down[x]; };
        for (int run = 0; run < runs; ++run) {
            const int x = run * kRun;
            if (near[run] == 0 && ((near[run - 1] | near[run + 1]) == 0 || (column(x - 1) | column(x + kRun)) == 0))
                continue;
            held[y - 1][run] = 1;
            mark_run(up + x, here + x, down + x, &cells.blocked[cells.at(x, y - 1)]);
        }
    }
}

void mark_outside(Cells& cells, const std::uint8_t* domain, std::vector<std::uint8_t>& occupied, Rows& held) {
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
            held[y][x / kRun] = 1;
            occupied[static_cast<std::size_t>(y >> kTileShift) * cells.tiles_x +
                     static_cast<std::size_t>(x >> kTileShift)] = 1;
        }
    }
}

// Sets `slits` to 1 where a free pixel of the run lies in no free square of two by two pixels. True if there are any.
FFSEG_CLONES
bool find_slits(const std::uint8_t* row, std::ptrdiff_t stride, std::uint8_t* __restrict slits) {
    const std::uint8_t *const up = row - stride, *const down = row + stride;
    Eight any = 0;
    for (int x = 0; x < kRun; x += kEight) {
        const Eight here = eight(row + x), left = eight(row + x - 1), right = eight(row + x + 1);
        const Eight above = eight(up + x) | ((eight(up + x - 1) | left) & (eight(up + x + 1) | right));
        const Eight below = eight(down + x) | ((eight(down + x - 1) | left) & (eight(down + x + 1) | right));
        const Eight shut = above & below & ~here & kOnes;
        std::memcpy(slits + x, &shut, sizeof shut);
        any |= shut;
    }
    return any != 0;
}

// Blocks slits: free space into which no free square of two by two pixels fits. Only runs that contain something
// blocked, or lie between two that do, are examined, and marked after the next row. A slit lies between edges on both
// sides, within their bands' reach, so the distances of free tiles stay valid.
void shut_slits(Cells& cells, Rows& held) {
    using Slits = std::array<std::uint8_t, kRun>;
    std::array<std::vector<std::pair<std::uint8_t*, Slits>>, 2> found;  // where, in this row and the one before
    for (int y = 0; y <= cells.height; ++y) {
        const std::uint8_t *const above = held[y - 1], *const here = held[y], *const below = above + (here - above) * 2;
        for (int x = 0, run = 0; y < cells.height && x < cells.width; x += kRun, ++run) {
            if ((here[run] | (above[run] & below[run])) == 0) continue;
            Slits slits;
            std::uint8_t* const row = &cells.blocked[cells.at(x, y)];
            if (!find_slits(row, static_cast<std::ptrdiff_t>(cells.stride), slits.data())) continue;
            std::fill(slits.begin() + std::min(kRun, cells.width - x), slits.end(), std::uint8_t{0});
            found[y % 2].emplace_back(row, slits);
        }
        for (const auto& [row, slits] : found[(y + 1) % 2]) {
            for (int x = 0; x < kRun; x += kEight) {
                const Eight sum = eight(row + x) | eight(&slits[x]);
                std::memcpy(row + x, &sum, sizeof sum);
            }
        }
        found[(y + 1) % 2].clear();
    }
}

}  // namespace

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
        // Across and down, all rows at once; what runs from one row into the next lies in the border, which is
        // occupied.
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

Cells::Cells(int h, int w, std::size_t padding)
    : height(h),
      width(w),
      stride(static_cast<std::size_t>(w) + 2),
      tiles_x(static_cast<std::size_t>((w - 1) >> kTileShift) + 1),
      tiles_y(static_cast<std::size_t>((h - 1) >> kTileShift) + 1),
      blocked((static_cast<std::size_t>(h) + 2) * stride + padding) {}

Field::Field(const std::uint8_t* edges, const std::uint8_t* domain, int height, int width)
    : cells_(height, width, kRun + 1) {
    std::vector<std::uint8_t> occupied((cells_.tiles_y + 1) * cells_.tiles_x + kRun);  // as far as whole runs reach
    Rows held(height, (width + kRun - 1) / kRun, 0);
    mark_edges(cells_, edges, occupied, held);
    mark_outside(cells_, domain, occupied, held);
    measure_reach(cells_, occupied);
    shut_slits(cells_, held);
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
