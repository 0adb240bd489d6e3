// Topology (Section 3.4): patches that cross are flipped (Algorithm 3, corrected).
#pragma once
#include <algorithm>

#include "freeform/topology/adjacent.hpp"
#include "freeform/topology/classify.hpp"
#include "freeform/topology/filter.hpp"

namespace ffseg::topology {

// With at most this many moving patches, each is compared with all others instead of sorting.
constexpr std::size_t kFewActive = 16;
// Rounds of crossing tests in one iteration; the remaining crossings wait for the next.
constexpr int kFlipRounds = 6;
// Cost of testing whether a flip cuts an edge, per degree, in units of one patch visit, and patch visits and pair
// tests allowed in one iteration, per patch; the remaining crossings wait for the next.
constexpr std::size_t kExchange = 16;
constexpr std::size_t kMaxVisits = 64;
// Pixels: patches near edges are halved down to this length before they are flipped, at most the second number of
// times, so that the flip cuts no edge.
constexpr double kFlipLength = 4.0;
constexpr int kFlipDepth = 4;

template <int D>
bool is_exhausted(const Contour<D>& contour) {
    return contour.effort.visits > contour.effort.most;
}

template <int D>
bool flip_finer(Contour<D>& contour, int i, int j, int depth);

// Do two control polygons cross properly?
template <int D>
bool polygons_cross(const Contour<D>& contour, int i, int j) {
    const auto &p = contour[i].control, &q = contour[j].control;
    for (int a = 0; a < D; ++a) {
        Box box;
        box.add(p[a]);
        box.add(p[a + 1]);
        if (!box.meets(contour.box(j))) continue;
        for (int b = 0; b < D; ++b) {
            if (segments_cross(p[a], p[a + 1], q[b], q[b + 1])) return true;
        }
    }
    return false;
}

// Algorithm 3, with the successors of i and j exchanged. Differs from the printed order, which does not connect.
template <int D>
bool flip(Contour<D>& contour, int i, int j, int depth) {
    const bool near_edges = (contour[i].near_edges || contour[j].near_edges) &&
                            contour.field.holds_solid(joined(contour.box(i), contour.box(j)));
    if (near_edges && depth < kFlipDepth && contour.options.refine &&
        std::max(contour.length(i), contour.length(j)) > kFlipLength) {
        return flip_finer(contour, i, j, depth);
    }
    const int after_i = contour[i].next, after_j = contour[j].next;
    const int inner = turning_inwards(contour, i, j);
    contour.effort.visits += kExchange * D;
    if (!exchange(contour, i, j)) return false;
    ++contour.counts.flips;
    for (const int near : {i, j, after_i, after_j, contour[i].prev, contour[j].prev}) contour.wake(near);
    for (const int changed : {i, j}) {
        contour[changed].touched = contour[changed].near_edges = true;
        contour[changed].steady = 0;
        contour[changed].before = contour[changed].m;
        contour.refresh(changed);
    }
    classify(contour, i, j, inner, false);
    return true;
}

// Patches whose hull may contain an edge are halved first, so that the part cut off is too short to contain one.
template <int D>
bool flip_finer(Contour<D>& contour, int i, int j, int depth) {
    contour.effort.visits += kExchange;
    const int i2 = contour.length(i) > kFlipLength ? contour.split(i) : -1;
    const int j2 = contour.length(j) > kFlipLength ? contour.split(j) : -1;
    for (const int half : {i, i2, j, j2}) {  // to be tested against all others in the next round
        if (half >= 0) contour[half].touched = true;
    }
    for (const int a : {i, i2}) {
        for (const int b : {j, j2}) {
            if (a < 0 || b < 0 || !contour.box(a).meets(contour.box(b)) || !polygons_cross(contour, a, b)) continue;
            if (contour[a].next == b || contour[b].next == a) continue;
            return flip(contour, a, b, depth + 1);
        }
    }
    return false;
}

// Flips i and j if they cross; true, too, if the budget of this iteration is spent. Resting pairs and, in later
// rounds, pairs that no flip has touched cannot have changed.
template <int D>
bool try_pair(Contour<D>& contour, int i, int j, bool only_touched) {
    const Patch<D>&a = contour[i], &b = contour[j];
    if (!a.alive || !b.alive || !(a.active || b.active)) return false;
    if (only_touched && !(a.touched || b.touched)) return false;
    if (a.next == j || b.next == i) return false;
    ++contour.effort.visits;
    if (is_exhausted(contour)) {
        contour.effort.unresolved = true;
        return true;
    }
    if (!polygons_cross(contour, i, j)) return false;
    const bool done = flip(contour, i, j, 0);
    contour.effort.unresolved = contour.effort.unresolved || !done;
    return done;
}

// One round of the filter: flips patches that cross. True if any did.
template <int D>
bool flip_round(Contour<D>& contour, bool only_touched) {
    const auto visit = [&](int i, int j) { return try_pair(contour, i, j, only_touched); };
    return contour.active.size() > kFewActive ? sweep(contour, visit) : compare_with_all(contour, visit);
}

template <int D>
void flip_crossings(Contour<D>& contour) {
    for (int i : contour.active) contour[i].touched = false;
    contour.effort.unresolved = false;
    contour.effort.visits = contour.effort.asked = 0;
    contour.effort.most = kMaxVisits * (contour.order.size() + kMaxVisits);
    bool crossing = true;
    for (int round = 0; round < kFlipRounds && crossing; ++round) crossing = flip_round(contour, round > 0);
    if (!crossing && !contour.effort.unresolved) {  // undecided components have become simple curves
        for (const auto& [i, j] : contour.undecided) {
            if (contour[i].alive && contour[j].alive) classify(contour, i, j, -1, true);
        }
        contour.undecided.clear();
    }
    const std::size_t count = contour.active.size();
    for (std::size_t at = 0; at < count; ++at) {
        flip_adjacent(contour, contour.active[at]);
        drop_turned(contour, contour.active[at]);
    }
    contour.rows.used = false;
}

}  // namespace ffseg::topology
