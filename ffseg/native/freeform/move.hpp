// Moving the samples along their normals, and the promise that the curve never enters an edge band.
#pragma once
#include "freeform/chain.hpp"

namespace ffseg {

// The outward normal at sample k: of the Bezier curve, at a joint the mean of both patches' normals.
template <int D>
Vec2 Chain<D>::normal_at(int i, int k, const Points& points) const {
    const Basis<D>& basis = Basis<D>::get();
    Vec2 tangent = apply<D>(basis.slope[k], points);
    double size = norm(tangent);
    if (size > 0) tangent = (1.0 / size) * tangent;
    if (k == 0) {
        const Vec2 other = apply<D>(basis.slope[D], pool_.samples(pool_[i].prev));
        const double other_size = norm(other);
        if (other_size > 0) tangent += (1.0 / other_size) * other;
        size = norm(tangent);
        if (size > 0) tangent = (1.0 / size) * tangent;
    }
    return {tangent.y, -tangent.x};
}

// How far a point may move along `normal`, at most `wanted`, before it meets what is blocked.
template <int D>
double Chain<D>::reach(Vec2 from, Vec2 normal, double wanted) const {
    if (!field_.crowded(from)) return std::min(wanted, Field::kFreeReach);
    const double limit = std::min(wanted, kCautiousStep);
    double s = 0.0;
    while (s < limit) {
        const double ahead = std::min(s + kMarchStep, limit);
        if (field_.blocked(from + ahead * normal)) break;
        s = ahead;
    }
    return s;
}

template <int D>
void Chain<D>::move_patch(int i) {
    const Points points = pool_.samples(i);
    Patch<D>& patch = pool_[i];
    patch.steady = patch.reverted = 0;
    patch.crowded = field_.crowded(points[D]);
    for (int k = 0; k < D; ++k) {
        const Vec2 normal = normal_at(i, k, points);
        const double s = reach(points[k], normal, options_.balloon);
        const bool crowded = field_.crowded(points[k]);
        Vec2 to = points[k] + s * normal;
        if (!crowded) {  // even out the spacing along the tangent; the shape keeps to first order
            const Vec2 back = k > 0 ? points[k - 1] : pool_[patch.prev].m[D - 1];
            const double slide = 0.25 * (norm(points[k + 1] - points[k]) - norm(points[k] - back));
            to += std::min(std::max(slide, -1.0), 1.0) * Vec2{-normal.y, normal.x};
        }
        patch.crowded |= crowded;
        if (s < kSteady) patch.steady |= static_cast<std::uint8_t>(1u << k);
        patch.before[k] = to;  // swapped with m when every sample has its target
    }
    // Between samples far apart the curve may come near edges that neither sample sees.
    if (!patch.crowded) patch.crowded = length(i) > D * Field::kFreeReach;
}

// All samples move at once (Eq. 7 with displacements along the normals).
template <int D>
void Chain<D>::move() {
    for (int i : active_) move_patch(i);
    for (int i : active_) {
        std::swap(pool_[i].m, pool_[i].before);
        const int prev = pool_[i].prev;
        if (!pool_[prev].active && (pool_[i].steady & 1u) == 0) {
            pool_[prev].before = pool_[prev].m;
            pool_[prev].steady = kAllSteady;
            pool_[prev].reverted = 0;
            pool_[prev].crowded = true;
            wake(prev);
        }
    }
}

// Does the curve between samples k and k + 1 meet something blocked? Edges are 4-connected
// chains of pixels, at least 0.7 pixels thick; the curve is looked at every 0.6 pixels or closer.
template <int D>
bool Chain<D>::interval_hits(const Points& points, int k) const {
    constexpr int kSub = Basis<D>::kSub;
    const Basis<D>& basis = Basis<D>::get();
    const double chord = norm(points[k + 1] - points[k]);
    if (chord > 0.6 * kSub) {
        const int pieces = 1 + static_cast<int>(chord / (0.6 * kSub));
        for (int j = 0; j < kSub; ++j) {  // far apart: straight pieces between the kSub curve points
            const Vec2 a = apply<D>(basis.between[k][j], points);
            const Vec2 b = j + 1 < kSub ? apply<D>(basis.between[k][j + 1], points) : points[k + 1];
            for (int piece = 0; piece < pieces; ++piece) {
                const double u = static_cast<double>(piece) / pieces;
                if (field_.solid(field_.clamp(a + u * (b - a)))) return true;
            }
        }
        return field_.solid(field_.clamp(points[k + 1]));
    }
    if (!field_.crowded(points[k]) && !field_.crowded(points[k + 1])) return false;
    const int stride = chord <= 1.2 ? 4 : chord <= 2.4 ? 2 : 1;
    for (int j = stride; j < kSub; j += stride) {
        if (field_.solid(field_.clamp(apply<D>(basis.between[k][j], points)))) return true;
    }
    return field_.solid(points[k + 1]) || field_.solid(points[k]);
}

template <int D>
int Chain<D>::first_hit(int i) const {
    const Points points = pool_.samples(i);
    for (int k = 0; k < D; ++k) {
        if (interval_hits(points, k)) return k;
    }
    return -1;
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
        const int k = first_hit(i);
        if (k < 0) break;
        stopped = true;
        const bool left = put_back(i, k), right = put_back(i, k + 1);
        if (!left && !right) break;
    }
    return stopped;
}

template <int D>
void Chain<D>::guard() {
    queue_.clear();
    for (int i : active_) {
        if (pool_[i].crowded && guard_patch(i)) pool_[i].wants_split = true;
    }
    for (std::size_t at = 0; at < queue_.size(); ++at) {
        const int i = queue_[at];
        if (guard_patch(i)) pool_[i].wants_split = true;
    }
}

// Could the curve of a resting patch still advance between its samples?
template <int D>
bool Chain<D>::uncovered(int i) const {
    constexpr int kSub = Basis<D>::kSub;
    const Basis<D>& basis = Basis<D>::get();
    const Points points = pool_.samples(i);
    for (int k = 0; k < D; ++k) {
        const double chord = norm(points[k + 1] - points[k]);
        if (chord < 2 * kMinSpacing) continue;
        const int stride = chord <= 3.0 ? 4 : chord <= 6.0 ? 2 : 1;
        for (int j = stride; j < kSub; j += stride) {
            const Vec2 tangent = apply<D>(basis.between_slope[k][j], points);
            const double size = norm(tangent);
            if (size == 0) continue;
            const Vec2 p = field_.clamp(apply<D>(basis.between[k][j], points));
            if (field_.blocked(p)) continue;
            const Vec2 normal{tangent.y / size, -tangent.x / size};
            if (reach(p, normal, kUncovered) >= kUncovered) return true;
        }
    }
    return false;
}

}  // namespace ffseg
