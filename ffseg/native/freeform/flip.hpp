// Topology: the flip (Algorithm 3, corrected).
#pragma once
#include "common/along.hpp"
#include "freeform/chain.hpp"

namespace ffseg::freeform {

// Calls visit(a, b) where side a of the polygon p crosses side b of q, until it returns true; whether it did.
template <std::size_t N, typename Visit>
bool visit_crossings(const std::array<Vec2, N>& p, const std::array<Vec2, N>& q, Visit visit) {
    for (std::size_t a = 0; a + 1 < N; ++a) {
        for (std::size_t b = 0; b + 1 < N; ++b) {
            if (segments_cross(p[a], p[a + 1], q[b], q[b + 1]) && visit(static_cast<int>(a), static_cast<int>(b))) return true;
        }
    }
    return false;
}

template <int D>
void Chain<D>::flip_crossings() {
    for (int i : active_) pool_[i].touched = false;
    unresolved_ = false;
    walked_ = 0;
    most_walked_ = kMostWalked * (sorted_.size() + kMostWalked);
    bool crossing = true;
    for (int round = 0; round < kFlipRounds && crossing; ++round) crossing = flip_round(round > 0);
    if (!crossing && !unresolved_) {  // what was left undecided has become a simple curve
        for (const auto& [i, j] : undecided_) {
            if (pool_[i].alive && pool_[j].alive) classify(i, j, -1, true);
        }
        undecided_.clear();
    }
    const std::size_t count = active_.size();
    for (std::size_t at = 0; at < count; ++at) flip_adjacent(active_[at]);
}

// D + 1 points evenly along the polygon p up to segment a, through `at`, along q from segment b on.
template <int D>
typename Chain<D>::Points Chain<D>::joined_at(const Points& p, int a, const Points& q, int b, Vec2 at) {
    std::array<Vec2, 2 * D + 3> path;
    std::size_t count = 0;
    for (int k = 0; k <= a; ++k) path[count++] = p[k];
    path[count++] = at;
    for (int k = b + 1; k <= D; ++k) path[count++] = q[k];
    Along along(path.data(), count, false);
    Points even;
    for (int k = 0; k <= D; ++k) even[k] = along.at(along.length() * k / D);
    even[0] = p[0];
    even[D] = q[D];
    return even;
}

// Gamma'_i = [P_0i .. P_ki, P_(k+1)j .. P_dj] and Gamma'_j = [P_0j .. P_kj, P_(k+1)i .. P_di], k = floor(d / 2), as
// samples. False where these still cross: the crossing lies far from the middle of a patch.
template <int D>
bool Chain<D>::swap_halves(int i, int j, Points& first, Points& second) const {
    Points p = pool_[i].control, q = pool_[j].control;
    for (int a = D / 2 + 1; a <= D; ++a) std::swap(p[a], q[a]);
    if (visit_crossings(p, q, [](int, int) { return true; })) return false;
    for (int k = 0; k <= D; ++k) {
        first[k] = apply<D>(kBasis<D>.vandermonde[k], p);
        second[k] = apply<D>(kBasis<D>.vandermonde[k], q);
    }
    return true;
}

// The same polygons joined where they cross, so that neither leaves the ground both have covered.
template <int D>
bool Chain<D>::join_at_crossing(const Points& p, const Points& q, Points& first, Points& second) {
    return visit_crossings(p, q, [&](int a, int b) {
        const Vec2 u = p[a + 1] - p[a];
        const double from = cross(u, q[b] - p[a]), to = cross(u, q[b + 1] - p[a]);  // of opposite signs
        const Vec2 at = q[b] + (from / (from - to)) * (q[b + 1] - q[b]);
        first = joined_at(p, a, q, b, at);
        second = joined_at(q, b, p, a, at);
        return true;
    });
}

// Gives i and j their new curves and exchanges their successors: the swapped halves, or where these cross or would cut
// an edge, the curves joined at their crossing. False, with nothing changed, where only the control polygons cross.
template <int D>
bool Chain<D>::exchange(int i, int j) {
    const Patch<D>&a = pool_[i], &b = pool_[j];
    const auto kept_i = a.m, kept_j = b.m;
    const int after_i = a.next, after_j = b.next;
    const Points p = pool_.samples(i), q = pool_.samples(j);
    const int before = num_hits(i) + num_hits(j);
    const auto apply_pair = [&](const Points& first, const Points& second) {
        std::copy_n(first.begin(), D, pool_[i].m.begin());
        std::copy_n(second.begin(), D, pool_[j].m.begin());
        keep_inside(i);
        keep_inside(j);
        pool_.link(i, after_j);
        pool_.link(j, after_i);
        return num_hits(i) + num_hits(j) <= before;
    };
    Points first, second;
    if (swap_halves(i, j, first, second) && apply_pair(first, second)) return true;
    pool_.link(i, after_i);
    pool_.link(j, after_j);
    if (join_at_crossing(p, q, first, second)) {
        // Up to a cubic the curve keeps to the joined samples; one of higher degree may swing round the corner into an
        // edge, and is replaced by one of lower degree or not joined at all.
        if (apply_pair(first, second) || D <= 3) return true;
        Points calm_first, calm_second;
        for (int k = 0; k <= D; ++k) {
            calm_first[k] = apply<D>(kBasis<D>.reduced[k], first);
            calm_second[k] = apply<D>(kBasis<D>.reduced[k], second);
        }
        if (apply_pair(calm_first, calm_second)) return true;
    }
    if (join_at_crossing(a.control, b.control, first, second) && apply_pair(first, second)) return true;
    pool_[i].m = kept_i;
    pool_[j].m = kept_j;
    pool_.link(i, after_i);
    pool_.link(j, after_j);
    return false;
}

// Which of two patches that change successors will turn towards the filled side; -1 where they cross more than once.
template <int D>
int Chain<D>::turning_inwards(int i, int j) const {
    const auto &p = pool_[i].control, &q = pool_[j].control;
    int crossings = 0, inner = -1;
    visit_crossings(p, q, [&](int a, int b) {
        inner = cross(p[a + 1] - p[a], q[b + 1] - q[b]) > 0 ? i : j;
        return ++crossings > 1;
    });
    return crossings == 1 ? inner : -1;
}

// Algorithm 3, and the successors of i and j change places. Differs from the order printed there, which does not connect.
template <int D>
bool Chain<D>::flip(int i, int j, int depth) {
    const bool crowded = (pool_[i].crowded || pool_[j].crowded) &&
                         field_.holds_solid(joined(pool_.box(i), pool_.box(j)));
    if (crowded && depth < kFlipDepth && options_.refine && std::max(length(i), length(j)) > kFlipLength) {
        return flip_finer(i, j, depth);
    }
    const int after_i = pool_[i].next, after_j = pool_[j].next;
    const int inner = turning_inwards(i, j);
    walked_ += kExchange * D;
    if (!exchange(i, j)) return false;
    ++counts_.flips;
    for (const int near : {i, j, after_i, after_j, pool_[i].prev, pool_[j].prev}) wake(near);
    for (const int changed : {i, j}) {
        pool_[changed].touched = pool_[changed].crowded = true;
        pool_[changed].steady = 0;
        pool_[changed].before = pool_[changed].m;
        pool_.refresh(changed);
    }
    classify(i, j, inner, false);
    return true;
}

// Where the hull of both may hold an edge they are halved first, so that what the flip cuts off is too short to hold one.
template <int D>
bool Chain<D>::flip_finer(int i, int j, int depth) {
    walked_ += kExchange;
    const int i2 = length(i) > kFlipLength ? split(i) : -1;
    const int j2 = length(j) > kFlipLength ? split(j) : -1;
    for (const int half : {i, i2, j, j2}) {  // to be compared with all others in the next round
        if (half >= 0) pool_[half].touched = true;
    }
    for (const int a : {i, i2}) {
        for (const int b : {j, j2}) {
            if (a < 0 || b < 0 || !pool_.box(a).meets(pool_.box(b)) || !polygons_cross(a, b)) continue;
            if (pool_[a].next == b || pool_[b].next == a) continue;
            return flip(a, b, depth + 1);
        }
    }
    return false;
}

// Do both control polygons advance along one direction? Then they cannot cross.
template <int D>
bool Chain<D>::runs_one_way(int i, int j) const {
    const auto &p = pool_[i].control, &q = pool_[j].control;
    const Vec2 along = q[D] - p[0];
    for (int k = 0; k < D; ++k) {
        if (dot(p[k + 1] - p[k], along) < 0 || dot(q[k + 1] - q[k], along) < 0) return false;
    }
    return true;
}

// Two adjacent patches that cross cut off a loop of their own, which is dropped at once; but if the loop may lie round
// an edge, they are halved, so that patches that are not adjacent meet in the next iteration.
template <int D>
void Chain<D>::flip_adjacent(int i) {
    if (!pool_[i].alive) return;
    const int j = pool_[i].next;
    if (j == i || pool_[j].next == i || !pool_[j].alive || runs_one_way(i, j)) return;
    const auto &p = pool_[i].control, &q = pool_[j].control;
    const bool crossing = visit_crossings(p, q, [](int a, int b) { return a != D - 1 || b != 0; });  // not at the joint
    if (!crossing) return;
    std::array<Vec2, 2 * D + 1> both;
    std::copy_n(pool_[i].m.begin(), D, both.begin());
    const Points second = pool_.samples(j);
    std::copy(second.begin(), second.end(), both.begin() + D);
    if (field_.encloses_solid(both.data(), both.size())) {
        for (const int half : {i, j}) {
            if (pool_[half].budget == 0 || !splittable(half)) continue;
            --pool_[half].budget;
            wake(half);
            split(half);
        }
        return;
    }
    Points joined = p;
    for (int a = D / 2 + 1; a <= D; ++a) joined[a] = q[a];
    const auto kept = pool_[i].m;
    const int after = pool_[j].next;
    pool_.set_control(i, joined);
    keep_inside(i);
    pool_.link(i, after);
    if (meets_edge(i)) {
        pool_[i].m = kept;
        pool_.link(i, j);
        pool_.link(j, after);
        return;
    }
    release(j);
    ++counts_.flips;
    pool_[i].steady = 0;
    wake(i);
    wake(after);
    pool_.refresh(i);
}

}  // namespace ffseg::freeform
