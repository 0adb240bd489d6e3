// Crossings of adjacent patches (left out in Section 3.4): the front folds over itself at a corner.
#pragma once
#include <algorithm>
#include <array>

#include "freeform/topology/exchange.hpp"

namespace ffseg::topology {

// Do both control polygons advance in a common direction? Then they cannot cross.
template <int D>
FFSEG_INLINE bool runs_one_way(const Contour<D>& contour, int i, int j) {
    const auto &p = contour[i].control, &q = contour[j].control;
    const Vec2 along = q[D] - p[0];
    for (int k = 0; k < D; ++k) {
        if (dot(p[k + 1] - p[k], along) < 0 || dot(q[k + 1] - q[k], along) < 0) return false;
    }
    return true;
}

// Do two adjacent patches cross other than at their joint?
template <int D>
bool adjacent_cross(const Contour<D>& contour, int i, int j) {
    if (runs_one_way(contour, i, j)) return false;
    const auto &p = contour[i].control, &q = contour[j].control;
    return visit_crossings(p, q, [](int a, int b) { return a != D - 1 || b != 0; });
}

// May an edge lie in the loop that two adjacent patches cut off?
template <int D>
bool loop_may_hold_edge(const Contour<D>& contour, int i, int j) {
    std::array<Vec2, 2 * D + 1> both;
    std::copy_n(contour[i].m.begin(), D, both.begin());
    const Points<D> second = contour.samples(j);
    std::copy(second.begin(), second.end(), both.begin() + D);
    return contour.field.encloses_solid(both.data(), both.size());
}

// Patch i takes the first half of its own polygon and the second half of that of j, which is removed; not if it would
// meet an edge.
template <int D>
void cut_loop_off(Contour<D>& contour, int i, int j) {
    Points<D> joined = contour[i].control;
    const auto& q = contour[j].control;
    for (int a = D / 2 + 1; a <= D; ++a) joined[a] = q[a];
    const auto kept = contour[i].m;
    const int after = contour[j].next;
    contour.set_control(i, joined);
    contour.keep_inside(i);
    contour.link(i, after);
    if (meets_edge(contour, i)) {
        contour[i].m = kept;
        contour.link(i, j);
        contour.link(j, after);
        return;
    }
    contour.retire(j);
    ++contour.counts.flips;
    contour[i].steady = 0;
    contour.wake(i);
    contour.wake(after);
    contour.refresh(i);
}

// Two adjacent patches that cross cut off a loop of their own, which is dropped at once; but if the loop may lie round
// an edge, they are halved, so that patches that are not adjacent meet in the next iteration.
template <int D>
void flip_adjacent(Contour<D>& contour, int i) {
    if (!contour[i].alive) return;
    const int j = contour[i].next;
    if (j == i || contour[j].next == i || !contour[j].alive || !adjacent_cross(contour, i, j)) return;
    if (!loop_may_hold_edge(contour, i, j)) return cut_loop_off(contour, i, j);
    for (const int half : {i, j}) {
        if (contour[half].budget == 0 || !contour.splittable(half)) continue;
        --contour[half].budget;
        contour.wake(half);
        contour.split(half);
    }
}

}  // namespace ffseg::topology
