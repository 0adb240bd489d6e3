// Moving the samples along their normals, and the promise that the curve never enters an edge band.
#pragma once
#include "freeform/chain.hpp"

namespace ffseg::freeform {

// How far a point may move along `normal`, at most `wanted`, before it meets what is blocked; `known` pixels are free.
template <int D>
double Chain<D>::reach(Vec2 from, Vec2 normal, double wanted, double known) const {
    const double limit = std::min(wanted, std::max(kCautiousStep, known));
    double s = std::min(limit, known);
    while (s < limit) {
        const double ahead = std::min(s + kMarchStep, limit);
        if (field_.blocked(from + ahead * normal)) break;
        s = ahead;
    }
    return s;
}

// The tangents of the Bezier curve at its samples and the distances between them, before anything moves.
template <int D>
void Chain<D>::measure(int i, Motion& motion) {
    motion.points = pool_.samples(i);
    for (int k = 0; k < D; ++k) motion.tangent[k] = unit(apply<D>(kBasis<D>.slope[k], motion.points));
    pool_[i].end_tangent = unit(apply<D>(kBasis<D>.slope[D], motion.points));
    for (int k = 0; k < D; ++k) motion.chord[k] = norm(motion.points[k + 1] - motion.points[k]);
    pool_[i].last_chord = motion.chord[D - 1];
}

template <int D>
void Chain<D>::move_patch(int i, const Motion& motion) {
    Patch<D>& patch = pool_[i];
    const Patch<D>& prev = pool_[patch.prev];
    patch.steady = patch.reverted = 0;
    double free = field_.free_reach(motion.points[D]);
    bool crowded = free <= 0;
    for (int k = D - 1; k >= 0; --k) {
        const double ahead = free;
        free = field_.free_reach(motion.points[k]);
        // Could the curve between this sample and the next, wherever they move now, be near anything blocked?
        crowded = crowded || free + ahead < kBulge * motion.chord[k] + 2 * options_.balloon;
        const Vec2 tangent = k > 0 ? motion.tangent[k] : unit(motion.tangent[0] + prev.end_tangent);
        const Vec2 normal{tangent.y, -tangent.x};
        const double s = reach(motion.points[k], normal, options_.balloon, free);
        Vec2 to = motion.points[k] + s * normal;
        if (free > s + 1.0) {  // even out the spacing along the tangent; the shape keeps to first order
            const double back = k > 0 ? motion.chord[k - 1] : prev.last_chord;
            to += std::min(std::max(0.25 * (motion.chord[k] - back), -1.0), 1.0) * tangent;
        }
        if (s < kSteady) patch.steady |= static_cast<std::uint8_t>(1u << k);
        patch.before[k] = to;  // swapped with m when every sample has its target
    }
    patch.crowded = crowded;
}

// All samples move at once (Eq. 7 with displacements along the normals, at a joint along the mean of both patches').
template <int D>
void Chain<D>::move() {
    motion_.resize(active_.size());
    for (std::size_t at = 0; at < active_.size(); ++at) measure(active_[at], motion_[at]);
    for (std::size_t at = 0; at < active_.size(); ++at) move_patch(active_[at], motion_[at]);
    const std::size_t count = active_.size();
    for (std::size_t at = 0; at < count; ++at) {
        const int i = active_[at], prev = pool_[i].prev;
        std::swap(pool_[i].m, pool_[i].before);
        if (pool_[prev].active || (pool_[i].steady & 1u) != 0) continue;
        pool_[prev].before = pool_[prev].m;
        pool_[prev].steady = kAllSteady;
        pool_[prev].reverted = 0;
        pool_[prev].crowded = true;
        wake(prev);
    }
}

// The square of the longest of some steps.
template <int D>
float widest2(const Places<D>& step) {
    Float4 most = all(0.0f);
    for (int q = 0; q < Places<D>::kFours; ++q) most = larger(most, step.x[q] * step.x[q] + step.y[q] * step.y[q]);
    return std::max(std::max(most[0], most[1]), std::max(most[2], most[3]));
}

// Does the curve between samples k and k + 1 meet an edge, which have `free` pixels round them in sum? Edges are 4-connected chains of pixels, at least 0.7 pixels
// thick; with the band round them they are three pixels thick, so that none hides between two places off the band that
// lie nearer to each other. The places looked at lie about evenly, but for a curve just made, which may swing about.
template <int D>
template <bool kMayOscillate>
bool Chain<D>::interval_hits(const Points& points, int k, double free) const {
    constexpr int kSub = Basis<D>::kSub;
    const double chord2 = norm2(points[k + 1] - points[k]), part = (kMayOscillate ? kOscillation : 1.0) * kBulge;
    if (free > 0 && free * free >= part * part * chord2) return false;
    const Places<D> at(kBasis<D>.looks[k], points);
    const unsigned seen = field_.look(at.x, at.y) | field_.look(points[k + 1]);
    if (Field::is_solid(seen)) return true;
    float gap2 = static_cast<float>(chord2) / (kSub * kSub);  // between two places looked at, squared
    if constexpr (kMayOscillate) gap2 = widest2(Places<D>(kBasis<D>.strides[k], points));
    if (gap2 <= (seen == 0 ? kLookAfar * kLookAfar : kLookEvery * kLookEvery)) return false;
    const Places<D> stride(kBasis<D>.strides[k], points);
    const int pieces = 1 + static_cast<int>(std::sqrt(gap2) / kLookEvery);
    for (int piece = 1; piece < pieces; ++piece) {  // straight, between the places looked at
        const float u = static_cast<float>(piece) / static_cast<float>(pieces);
        auto x = at.x, y = at.y;
        for (int q = 0; q < Places<D>::kFours; ++q) {
            x[q] = x[q] + stride.x[q] * u;
            y[q] = y[q] + stride.y[q] * u;
        }
        if (Field::is_solid(field_.look(x, y))) return true;
    }
    return false;
}

// The first stretch of a patch that meets an edge, -1 if none does.
template <int D>
template <bool kMayOscillate>
int Chain<D>::first_hit(int i) const {
    const Points points = pool_.samples(i);
    double behind = field_.free_reach(points[0]);
    for (int k = 0; k < D; ++k) {
        const double ahead = field_.free_reach(points[k + 1]);
        if (interval_hits<kMayOscillate>(points, k, behind + ahead)) return k;
        behind = ahead;
    }
    return -1;
}

// The number of stretches of a patch just made that meet an edge.
template <int D>
int Chain<D>::num_hits(int i) const {
    const Points points = pool_.samples(i);
    int hits = 0;
    for (int k = 0; k < D; ++k) {
        hits += interval_hits<true>(points, k, field_.free_reach(points[k]) + field_.free_reach(points[k + 1]));
    }
    return hits;
}

// Puts sample k of patch i (k = D: the next patch's joint) back where it was. False if it already is.
template <int D>
bool Chain<D>::put_back(int i, int k) {
    const int owner = k == D ? pool_[i].next : i, at = k == D ? 0 : k;
    Patch<D>& patch = pool_[owner];
    const auto bit = static_cast<std::uint8_t>(1u << at);
    if (!patch.active || (patch.reverted & bit) != 0) return false;
    patch.reverted |= bit;
    patch.steady |= bit;
    patch.m[at] = patch.before[at];
    if (at == 0) queue_.push_back(k == D ? owner : patch.prev);
    return true;
}

// Puts samples back until the curve meets no edge; the state before the move met none. Says whether it was stopped.
template <int D>
bool Chain<D>::guard_patch(int i) {
    bool stopped = false;
    for (int tries = 0; tries <= D; ++tries) {
        const int k = first_hit<false>(i);
        if (k < 0) break;
        stopped = true;
        const bool left = put_back(i, k), right = put_back(i, k + 1);
        if (left || right) continue;
        bool any = false;  // the samples farther off bend the curve here as well, the less the farther
        for (int ring = 1; ring < D && !any; ++ring) {
            any = k >= ring && put_back(i, k - ring);
            any = (k + 1 + ring <= D && put_back(i, k + 1 + ring)) || any;
        }
        if (!any) break;
    }
    return stopped;
}

template <int D>
void Chain<D>::guard() {
    queue_.clear();
    for (int i : active_) {
        const Patch<D>& patch = pool_[i];
        const bool still = patch.steady == kAllSteady && (pool_[patch.next].steady & 1u) != 0;
        if (patch.crowded && !still && guard_patch(i)) pool_[i].wants_split = true;
    }
    for (std::size_t at = 0; at < queue_.size(); ++at) {
        const int i = queue_[at];
        if (guard_patch(i)) pool_[i].wants_split = true;
    }
}

// A patch near edges that gets on has all its repairs again: as often as there are tiles, so the evolution ends.
template <int D>
void Chain<D>::reward_progress() {
    for (const int i : active_) {
        Patch<D>& patch = pool_[i];
        if (patch.budget > kSplitBudget / 2) continue;
        for (int k = 0; k < D; ++k) {
            std::uint8_t& tile = reached_[field_.tile(patch.m[k])];
            if (tile == 0 && (patch.steady >> k & 1u) == 0) {
                tile = 1;
                patch.budget = kSplitBudget;
            }
        }
    }
}

}  // namespace ffseg::freeform
