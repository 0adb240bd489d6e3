#include "raster/raster.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "raster/side.hpp"

namespace ffseg::raster {
namespace {

// One row's crossings: per column the sum of signs of edges that pass left of or through its centre but right of the
// column before, and one bit per column that was touched, so that a row costs its crossings and not its width.
class CrossingRow {
public:
    explicit CrossingRow(int width) : width_(width), change_(width + 1, 0), touched_(width / 64 + 1, 0) {}

    void add(int column, int change) {
        change_[column] += change;
        touched_[column / 64] |= std::uint64_t{1} << (column % 64);
    }

    // Writes the row and clears itself.
    void write(std::uint8_t* row) {
        int winding = 0, from = 0;
        std::memset(row, 0, static_cast<std::size_t>(width_));
        for (std::size_t word = 0; word < touched_.size(); ++word) {
            for (std::uint64_t bits = touched_[word]; bits != 0; bits &= bits - 1) {
                const int column = static_cast<int>(word) * 64 + lowest(bits);
                if (winding > 0) std::memset(row + from, 1, static_cast<std::size_t>(column - from));
                winding += change_[column];
                change_[column] = 0;
                from = column;
            }
            touched_[word] = 0;
        }
        if (winding > 0) std::memset(row + from, 1, static_cast<std::size_t>(width_ - from));
    }

private:
    static int lowest(std::uint64_t bits) {
        int index = 0;
        for (; (bits & 0xff) == 0; bits >>= 8) index += 8;
        for (; (bits & 1) == 0; bits >>= 1) ++index;
        return index;
    }

    int width_;
    std::vector<int> change_;
    std::vector<std::uint64_t> touched_;
};

// Smallest integer >= value, brought to 0..limit.
int ceil_clamped(double value, int limit) {
    const double inside = std::clamp(value, 0.0, static_cast<double>(limit));
    const int whole = static_cast<int>(inside);
    return whole + (whole < inside ? 1 : 0);
}

// First column, 0..width, whose centre is not strictly left of the edge on row y; exact.
int column_of(const Edge& edge, double y, int width) {
    if (edge.low.x == edge.high.x) return ceil_clamped(edge.low.x, width);
    const double dx = edge.high.x - edge.low.x, dy = edge.high.y - edge.low.y;
    const double x = edge.low.x + dx * ((y - edge.low.y) / dy);
    // Four roundings of values no larger than the ends' sum; doubled.
    const double slack = 8 * std::numeric_limits<double>::epsilon() * (std::abs(edge.low.x) + std::abs(edge.high.x));
    int first = ceil_clamped(x - slack, width);
    int last = ceil_clamped(x + slack, width);
    while (first < last) {  // a centre lies within rounding of the edge: ask exactly
        const int centre = first + (last - first) / 2;
        if (exact_side(edge.low, edge.high, {double(centre), y}) > 0) {
            first = centre + 1;
        } else {
            last = centre;
        }
    }
    return first;
}

struct Rows {
    int first, end;
};

Rows rows_of(const Edge& edge, int height) {
    return {ceil_clamped(edge.low.y, height), ceil_clamped(edge.high.y, height)};
}

// Indices of the edges in order of their first row: edges of row y are order[begin[y]..begin[y + 1]).
struct ByRow {
    std::vector<std::size_t> begin, order;

    ByRow(const std::vector<Edge>& edges, int height) : begin(static_cast<std::size_t>(height) + 2, 0) {
        for (const Edge& edge : edges) {
            const Rows rows = rows_of(edge, height);
            if (rows.first < rows.end) ++begin[rows.first + 1];
        }
        for (int y = 0; y < height; ++y) begin[y + 1] += begin[y];
        order.resize(begin[height]);
        std::vector<std::size_t> next(begin);
        for (std::size_t i = 0; i < edges.size(); ++i) {
            const Rows rows = rows_of(edges[i], height);
            if (rows.first < rows.end) order[next[rows.first]++] = i;
        }
    }
};

}  // namespace

void append_contour(const Vec2* points, std::size_t count, int degree, const PixelGrid& grid,
                    std::vector<Edge>& edges) {
    for (std::size_t begin = 0; begin < count; begin += static_cast<std::size_t>(degree)) {
        std::array<Vec2, kMaxDegree + 1> patch;
        for (int i = 0; i < degree; ++i) patch[i] = points[begin + i];
        patch[degree] = points[(begin + degree) % count];
        append_edges(patch.data(), degree, grid, edges);
    }
}

void fill_mask(const std::vector<Edge>& edges, const MaskView& mask) {
    if (mask.height == 0 || mask.width == 0) return;  // its data may be null
    const ByRow by_row(edges, mask.height);
    CrossingRow crossings(mask.width);
    std::vector<std::size_t> active;
    for (int y = 0; y < mask.height; ++y) {
        active.insert(active.end(), by_row.order.begin() + by_row.begin[y], by_row.order.begin() + by_row.begin[y + 1]);
        std::size_t kept = 0;
        for (const std::size_t index : active) {
            const Edge& edge = edges[index];
            if (!(y < edge.high.y)) continue;
            active[kept++] = index;
            crossings.add(column_of(edge, y, mask.width), -edge.sign);
        }
        active.resize(kept);
        crossings.write(mask.data + static_cast<std::size_t>(y) * mask.width);
    }
}

std::vector<Span> fill_spans(const std::vector<Edge>& edges, int height, int width) {
    std::vector<Span> spans;
    if (height == 0 || width == 0) return spans;
    const ByRow by_row(edges, height);
    std::vector<std::size_t> active;
    std::vector<std::pair<int, int>> crossings;  // column and change of the winding number
    for (int y = 0; y < height; ++y) {
        active.insert(active.end(), by_row.order.begin() + by_row.begin[y], by_row.order.begin() + by_row.begin[y + 1]);
        crossings.clear();
        std::size_t kept = 0;
        for (const std::size_t index : active) {
            if (!(y < edges[index].high.y)) continue;
            active[kept++] = index;
            crossings.emplace_back(column_of(edges[index], y, width), -edges[index].sign);
        }
        active.resize(kept);
        std::sort(crossings.begin(), crossings.end());
        int winding = 0;
        for (std::size_t i = 0; i < crossings.size(); ++i) {
            const bool was_inside = winding > 0;
            const int column = crossings[i].first;
            for (winding += crossings[i].second; i + 1 < crossings.size() && crossings[i + 1].first == column; ++i) {
                winding += crossings[i + 1].second;
            }
            if (!was_inside && winding > 0 && column < width) spans.push_back({y, column, width});
            if (was_inside && winding <= 0) spans.back().end = column;
        }
    }
    return spans;
}

}  // namespace ffseg::raster
