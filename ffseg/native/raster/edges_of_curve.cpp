#include "raster/edges_of_curve.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace ffseg::raster {
namespace {

using Patch = std::array<Vec2, kMaxDegree + 1>;

// Up to this many chords a piece is sampled outright; a longer one is halved first, so that its far parts are dropped.
constexpr double kMaxChords = 32.0;
// Each halving divides the bend by four: 1e100 px comes below any tolerance in 200. Rounding could stall it; this ends
// it.
constexpr int kMaxHalvings = 256;

Vec2 middle(Vec2 a, Vec2 b) { return 0.5 * a + 0.5 * b; }

void append_chord(Vec2 from, Vec2 to, std::vector<Edge>& edges) {
    if (from.y < to.y) edges.push_back({from, to, 1});
    if (to.y < from.y) edges.push_back({to, from, -1});
}

// Number of equal steps whose chords stay within the tolerance: h^2 |B''| / 8 <= tolerance.
double chord_count(const Patch& p, int degree, double tolerance) {
    double bend = 0.0;
    for (int i = 0; i + 2 <= degree; ++i) {
        const Vec2 second = (p[i] - p[i + 1]) + (p[i + 2] - p[i + 1]);
        bend = std::max(bend, std::abs(second.x) + std::abs(second.y));  // >= its length, and cannot overflow
    }
    return std::max(1.0, std::ceil(std::sqrt(degree * (degree - 1) / 8.0 * (bend / tolerance))));
}

Vec2 evaluate(Patch p, int degree, double t) {
    for (int level = degree; level > 0; --level) {
        for (int i = 0; i < level; ++i) p[i] = (1.0 - t) * p[i] + t * p[i + 1];
    }
    return p[0];
}

void append_samples(const Patch& p, int degree, int chords, std::vector<Edge>& edges) {
    Vec2 from = p[0];
    for (int k = 1; k < chords; ++k) {
        const Vec2 to = evaluate(p, degree, static_cast<double>(k) / chords);
        append_chord(from, to, edges);
        from = to;
    }
    append_chord(from, p[degree], edges);
}

// Leaves the first half in p and returns the second.
Patch halve(Patch& p, int degree) {
    Patch second = p, column = p;
    for (int level = degree; level > 0; --level) {
        second[level] = column[level];
        for (int i = 0; i < level; ++i) column[i] = middle(column[i], column[i + 1]);
        p[degree - level + 1] = column[0];
    }
    second[0] = column[0];
    return second;
}

void append_piece(Patch p, int degree, const PixelGrid& grid, int halvings, std::vector<Edge>& edges) {
    for (;; ++halvings) {
        Box box;
        for (int i = 0; i <= degree; ++i) box.add(p[i]);
        if (box.y1 < 0.0 || box.y0 > grid.bottom || box.x0 > grid.right) return;
        if (box.x1 <= 0.0 || halvings == kMaxHalvings) return append_chord(p[0], p[degree], edges);
        const double chords = chord_count(p, degree, grid.tolerance);
        if (chords <= kMaxChords) return append_samples(p, degree, static_cast<int>(chords), edges);
        const Patch second = halve(p, degree);
        append_piece(p, degree, grid, halvings + 1, edges);
        p = second;
    }
}

}  // namespace

void append_edges(const Vec2* patch, int degree, const PixelGrid& grid, std::vector<Edge>& edges) {
    Patch p{};
    std::copy(patch, patch + degree + 1, p.begin());
    append_piece(p, degree, grid, 0, edges);
}

}  // namespace ffseg::raster
