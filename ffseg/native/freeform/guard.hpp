// The guarantee that the curve never enters an edge band: samples are put back if it does (Section 3.2).
#pragma once
#include <algorithm>
#include <cmath>

#include "freeform/deform.hpp"

namespace ffseg::freeform {

// Pixels between the points at which the curve between two samples is tested: less than the thickness of a 4-connected
// chain, and away from the edge band less than the width of that band, which the curve may cross obliquely.
constexpr float kTestEvery = 0.7f, kTestAfar = 1.75f;

// The square of the longest step.
template <int D>
float widest2(const Places<D>& step) {
    Float4 most = all(0.0f);
    for (int q = 0; q < Places<D>::kFours; ++q) most = larger(most, step.x[q] * step.x[q] + step.y[q] * step.y[q]);
    return std::max(std::max(most[0], most[1]), std::max(most[2], most[3]));
}

// Does the curve between samples k and k + 1 meet an edge? `free` is the sum of the free radii round both. Edges are
// 4-connected chains of pixels, at least 0.7 pixels thick, and three pixels with their band: none fits between two
// tested points off the band that are nearer to each other. The points are about evenly spaced, except on a new curve,
// which may oscillate.
template <bool kMayOscillate, int D>
bool interval_hits(const Contour<D>& contour, const Points<D>& points, const Spread<D>& spread, int k, double free) {
    constexpr int kSub = Basis<D>::kSub;
    const double chord2 = norm2(points[k + 1] - points[k]), part = (kMayOscillate ? kOscillation : 1.0) * kBulge;
    if (free > 0 && free * free >= part * part * chord2) return false;
    const Places<D> at(kBasis<D>.places[k], spread);
    const unsigned seen = contour.field.contents(at.x, at.y) | contour.field.contents(points[k + 1]);
    if (field::Field::is_solid(seen)) return true;
    float gap2 = static_cast<float>(chord2) / (kSub * kSub);  // between tested points, squared
    if constexpr (kMayOscillate) gap2 = widest2(Places<D>(kBasis<D>.strides[k], spread));
    if (gap2 <= (seen == 0 ? kTestAfar * kTestAfar : kTestEvery * kTestEvery)) return false;
    const Places<D> stride(kBasis<D>.strides[k], spread);
    const int pieces = 1 + static_cast<int>(std::sqrt(gap2) / kTestEvery);
    for (int piece = 1; piece < pieces; ++piece) {  // straight, between tested points
        const float u = static_cast<float>(piece) / static_cast<float>(pieces);
        auto x = at.x, y = at.y;
        for (int q = 0; q < Places<D>::kFours; ++q) {
            x[q] = x[q] + stride.x[q] * u;
            y[q] = y[q] + stride.y[q] * u;
        }
        if (field::Field::is_solid(contour.field.contents(x, y))) return true;
    }
    return false;
}

// The first interval of a patch that meets an edge, -1 if none does.
template <bool kMayOscillate, int D>
int first_hit(const Contour<D>& contour, int i) {
    const Points<D> points = contour.samples(i);
    const Spread<D> spread(points);
    double behind = contour.field.free_reach(points[0]);
    for (int k = 0; k < D; ++k) {
        const double ahead = contour.field.free_reach(points[k + 1]);
        if (interval_hits<kMayOscillate>(contour, points, spread, k, behind + ahead)) return k;
        behind = ahead;
    }
    return -1;
}

// Does the curve of a new patch meet an edge?
template <int D>
bool meets_edge(const Contour<D>& contour, int i) {
    return first_hit<true>(contour, i) >= 0;
}

// The number of intervals of a new patch that meet an edge.
template <int D>
int num_hits(const Contour<D>& contour, int i) {
    const Points<D> points = contour.samples(i);
    const Spread<D> spread(points);
    int hits = 0;
    for (int k = 0; k < D; ++k) {
        hits += interval_hits<true>(contour, points, spread, k,
                                    contour.field.free_reach(points[k]) + contour.field.free_reach(points[k + 1]));
    }
    return hits;
}

// Puts sample k of patch i (k = D: the next patch's joint) back where it was. False if it already is.
template <int D>
bool put_back(Contour<D>& contour, int i, int k) {
    const int owner = k == D ? contour[i].next : i, at = k == D ? 0 : k;
    Patch<D>& patch = contour[owner];
    const auto bit = static_cast<std::uint8_t>(1u << at);
    if (!patch.active || (patch.reverted & bit) != 0) return false;
    patch.reverted |= bit;
    patch.steady |= bit;
    patch.m[at] = patch.before[at];
    if (at == 0) contour.buffers.queue.push_back(k == D ? owner : patch.prev);
    return true;
}

// Puts samples back until the curve meets no edge, as before the move. True if it was stopped.
template <int D>
bool hold_patch(Contour<D>& contour, int i) {
    bool stopped = false;
    for (int tries = 0; tries <= D; ++tries) {
        const int k = first_hit<(D > 3)>(contour, i);  // curves of higher degree oscillate before they are repaired
        if (k < 0) break;
        stopped = true;
        const bool left = put_back(contour, i, k), right = put_back(contour, i, k + 1);
        if (left || right) continue;
        bool any = false;  // more distant samples influence the curve here, too, though less
        for (int ring = 1; ring < D && !any; ++ring) {
            any = k >= ring && put_back(contour, i, k - ring);
            any = (k + 1 + ring <= D && put_back(contour, i, k + 1 + ring)) || any;
        }
        if (!any) break;
    }
    return stopped;
}

template <int D>
void hold_at_edges(Contour<D>& contour) {
    contour.buffers.queue.clear();
    for (int i : contour.active) {
        const Patch<D>& patch = contour[i];
        const bool still = patch.steady == kAllSteady<D> && (contour[patch.next].steady & 1u) != 0;
        if (patch.near_edges && !still && hold_patch(contour, i)) contour[i].wants_split = true;
    }
    for (std::size_t at = 0; at < contour.buffers.queue.size(); ++at) {
        const int i = contour.buffers.queue[at];
        if (hold_patch(contour, i)) contour[i].wants_split = true;
    }
}

}  // namespace ffseg::freeform
