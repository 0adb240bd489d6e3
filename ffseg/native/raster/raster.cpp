#include "raster/raster.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "raster/side.hpp"

namespace ffseg::raster {
namespace {

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

// An edge that passes left of or through the centre of `column`, but right of the column before.
struct Crossing {
    int column, change;
};

// The crossings of the edges with the rows of centres: those of row y are at[begin[y]..begin[y + 1]).
struct ByRow {
    std::vector<std::size_t> begin;
    std::vector<Crossing> at;

    ByRow(const std::vector<Edge>& edges, int height, int width) : begin(static_cast<std::size_t>(height) + 1, 0) {
        std::vector<std::pair<int, Crossing>> found;
        found.reserve(edges.size());
        for (const Edge& edge : edges) {
            const int end = ceil_clamped(edge.high.y, height);
            for (int y = ceil_clamped(edge.low.y, height); y < end; ++y) {
                found.push_back({y, {column_of(edge, y, width), -edge.sign}});
                ++begin[y];
            }
        }
        std::size_t total = 0;
        for (std::size_t& row : begin) row = total += row;
        at.resize(total);
        for (const auto& [y, crossing] : found) at[--begin[y]] = crossing;
    }
};

// Calls use(y, begin, end) for the runs of pixels whose winding number is > 0, in order of row and column.
template <class Use>
void each_span(const std::vector<Edge>& edges, int height, int width, const Use& use) {
    ByRow rows(edges, height, width);
    for (int y = 0; y < height; ++y) {
        const auto first = rows.at.begin() + rows.begin[y], last = rows.at.begin() + rows.begin[y + 1];
        std::sort(first, last, [](const Crossing& a, const Crossing& b) { return a.column < b.column; });
        int winding = 0, from = 0;
        for (auto one = first; one != last;) {
            const bool was_inside = winding > 0;
            const int column = one->column;
            for (; one != last && one->column == column; ++one) winding += one->change;
            if (!was_inside && winding > 0) from = column;
            if (was_inside && winding <= 0) use(y, from, column);
        }
        if (winding > 0 && from < width) use(y, from, width);
    }
}

}  // namespace

void fill_mask(const std::vector<Edge>& edges, const MaskView& mask) {
    if (mask.height == 0 || mask.width == 0) return;  // its data may be null
    const std::size_t width = static_cast<std::size_t>(mask.width);
    std::memset(mask.data, 0, width * mask.height);
    each_span(edges, mask.height, mask.width, [&](int y, int begin, int end) {
        std::memset(mask.data + y * width + begin, 1, static_cast<std::size_t>(end - begin));
    });
}

std::vector<Span> fill_spans(const std::vector<Edge>& edges, int height, int width) {
    std::vector<Span> spans;
    each_span(edges, height, width, [&](int y, int begin, int end) { spans.push_back({y, begin, end}); });
    return spans;
}

}  // namespace ffseg::raster
