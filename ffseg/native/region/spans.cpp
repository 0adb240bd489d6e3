#include "region/spans.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace ffseg::region {
namespace {

// Index of the first span of each row, and one past the last.
std::vector<std::size_t> row_begins(const Spans& spans, int height) {
    std::vector<std::size_t> begin(static_cast<std::size_t>(height) + 1, 0);
    for (const Span& span : spans) ++begin[span.y + 1];
    for (int y = 0; y < height; ++y) begin[y + 1] += begin[y];
    return begin;
}

bool starts_before(const Span& a, const Span& b) { return a.begin < b.begin; }

// Joins what touches or overlaps in one row; in order afterwards.
void join(Spans& row) {
    std::sort(row.begin(), row.end(), starts_before);
    std::size_t kept = 0;
    for (const Span& span : row) {
        if (kept > 0 && span.begin <= row[kept - 1].end) {
            row[kept - 1].end = std::max(row[kept - 1].end, span.end);
        } else {
            row[kept++] = span;
        }
    }
    row.resize(kept);
}

void append_common(const Spans& row, const Span* other, const Span* end, Spans& out) {
    for (const Span& span : row) {
        while (other != end && other->end <= span.begin) ++other;
        for (const Span* each = other; each != end && each->begin < span.end; ++each) {
            out.push_back({each->y, std::max(each->begin, span.begin), std::min(each->end, span.end)});
        }
    }
}

}  // namespace

Spans complement(const Spans& spans, int height, int width) {
    Spans rest;
    std::size_t next = 0;
    for (int y = 0; y < height; ++y) {
        int from = 0;
        for (; next < spans.size() && spans[next].y == y; ++next) {
            if (from < spans[next].begin) rest.push_back({y, from, spans[next].begin});
            from = spans[next].end;
        }
        if (from < width) rest.push_back({y, from, width});
    }
    return rest;
}

Spans near(const Spans& spans, const Spans& other, double radius, int height, int width) {
    const std::vector<std::size_t> begin = row_begins(spans, height), others = row_begins(other, height);
    const int rows = static_cast<int>(std::min<double>(std::floor(radius), height));
    Spans found, row;
    for (int y = 0; y < height; ++y) {
        if (others[y] == others[y + 1]) continue;
        row.clear();
        for (int v = std::max(0, y - rows); v <= std::min(height - 1, y + rows); ++v) {
            const double reach = std::sqrt(radius * radius - static_cast<double>(v - y) * (v - y));
            const int half = static_cast<int>(std::min<double>(reach, width));
            for (std::size_t i = begin[v]; i < begin[v + 1]; ++i) {
                row.push_back({y, std::max(0, spans[i].begin - half), std::min(width, spans[i].end + half)});
            }
        }
        join(row);
        append_common(row, other.data() + others[y], other.data() + others[y + 1], found);
    }
    return found;
}

}  // namespace ffseg::region
