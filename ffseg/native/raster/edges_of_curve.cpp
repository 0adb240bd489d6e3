#include "raster/edges_of_curve.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace ffseg::raster {
namespace {

template <int D>
using Patch = std::array<Vec2, D + 1>;

// Up to this many chords a piece is sampled outright; a longer one is halved first, so that its far parts are dropped.
constexpr double kMaxChords = 32.0;
// Each halving divides the bend by four: 1e100 px comes below any tolerance in 200. Rounding could stall it; this ends
// it.
constexpr int kMaxHalvings = 256;

Vec2 middle(Vec2 a, Vec2 b) { return 0.5 * a + 0.5 * b; }

void append_chord(Vec2 from, Vec2 to, std::vector<Edge>& edges) {
    if (from.y == to.y) return;
    Edge& edge = edges.emplace_back();
    const bool falls = from.y < to.y;
    edge.low = falls ? from : to;
    edge.high = falls ? to : from;
    edge.sign = falls ? 1 : -1;
}

// Number of equal steps whose chords stay within the tolerance: h^2 |B''| / 8 <= tolerance.
template <int D>
double chord_count(const Patch<D>& p, double tolerance) {
    double bend = 0.0;
    for (int i = 0; i + 2 <= D; ++i) {
        const Vec2 second = (p[i] - p[i + 1]) + (p[i + 2] - p[i + 1]);
        bend = std::max(bend, std::abs(second.x) + std::abs(second.y));  // >= its length, and cannot overflow
    }
    return std::max(1.0, std::ceil(std::sqrt(D * (D - 1) / 8.0 * (bend / tolerance))));
}

template <int D>
FFSEG_INLINE Vec2 evaluate(Patch<D> p, double t) {
    for (int level = D; level > 0; --level) {
        for (int i = 0; i < level; ++i) p[i] = (1.0 - t) * p[i] + t * p[i + 1];
    }
    return p[0];
}

template <int D>
void append_samples(const Patch<D>& p, int chords, std::vector<Edge>& edges) {
    Vec2 from = p[0];
    for (int k = 1; k < chords; ++k) {
        const Vec2 to = evaluate<D>(p, static_cast<double>(k) / chords);
        append_chord(from, to, edges);
        from = to;
    }
    append_chord(from, p[D], edges);
}

// Leaves the first half in p and returns the second.
template <int D>
Patch<D> halve(Patch<D>& p) {
    Patch<D> second = p, column = p;
    for (int level = D; level > 0; --level) {
        second[level] = column[level];
        for (int i = 0; i < level; ++i) column[i] = middle(column[i], column[i + 1]);
        p[D - level + 1] = column[0];
    }
    second[0] = column[0];
    return second;
}

template <int D>
void append_piece(Patch<D> p, const PixelGrid& grid, int halvings, std::vector<Edge>& edges) {
    for (;; ++halvings) {
        Box box;
        for (const Vec2 point : p) box.add(point);
        if (box.y1 < grid.first || box.y0 > grid.bottom || box.x0 > grid.right) return;
        if (box.x1 <= grid.first || halvings == kMaxHalvings) return append_chord(p[0], p[D], edges);
        const double chords = chord_count<D>(p, grid.tolerance);
        if (chords <= kMaxChords) return append_samples<D>(p, static_cast<int>(chords), edges);
        const Patch<D> second = halve<D>(p);
        append_piece<D>(p, grid, halvings + 1, edges);
        p = second;
    }
}

template <int D>
void append_patches(const Vec2* points, std::size_t count, const PixelGrid& grid, std::vector<Edge>& edges) {
    for (std::size_t begin = 0; begin < count; begin += D) {
        Patch<D> patch;
        std::copy(points + begin, points + begin + D, patch.begin());
        patch[D] = points[(begin + D) % count];
        append_piece<D>(patch, grid, 0, edges);
    }
}

}  // namespace

void append_contour(const Vec2* points, std::size_t count, int degree, const PixelGrid& grid,
                    std::vector<Edge>& edges) {
    constexpr std::array kAppend{append_patches<1>, append_patches<2>, append_patches<3>,
                                 append_patches<4>, append_patches<5>, append_patches<6>};
    static_assert(kAppend.size() == kMaxDegree);
    kAppend[static_cast<std::size_t>(degree) - 1](points, count, grid, edges);
}

}  // namespace ffseg::raster
