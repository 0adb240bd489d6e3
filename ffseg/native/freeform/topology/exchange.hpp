// Exchange of halves between two patches (Algorithm 3, corrected): the new curves.
#pragma once
#include <algorithm>
#include <array>

#include "common/along.hpp"
#include "freeform/guard.hpp"

namespace ffseg::topology {

using freeform::apply;
using freeform::Contour;
using freeform::kBasis;
using freeform::Patch;
using freeform::Points;

// Calls visit(a, b) for each side a of the polygon p that crosses side b of q, until one returns true; true if so.
template <std::size_t N, typename Visit>
bool visit_crossings(const std::array<Vec2, N>& p, const std::array<Vec2, N>& q, Visit visit) {
    for (std::size_t a = 0; a + 1 < N; ++a) {
        for (std::size_t b = 0; b + 1 < N; ++b) {
            if (segments_cross(p[a], p[a + 1], q[b], q[b + 1]) && visit(static_cast<int>(a), static_cast<int>(b)))
                return true;
        }
    }
    return false;
}

// D + 1 points evenly along the polygon p up to segment a, through `at`, along q from segment b on.
template <int D>
Points<D> joined_at(const Points<D>& p, int a, const Points<D>& q, int b, Vec2 at) {
    std::array<Vec2, 2 * D + 3> path;
    std::size_t count = 0;
    for (int k = 0; k <= a; ++k) path[count++] = p[k];
    path[count++] = at;
    for (int k = b + 1; k <= D; ++k) path[count++] = q[k];
    Along along(path.data(), count, false);
    Points<D> even;
    for (int k = 0; k <= D; ++k) even[k] = along.at(along.length() * k / D);
    even[0] = p[0];
    even[D] = q[D];
    return even;
}

// Gamma'_i = [P_0i .. P_ki, P_(k+1)j .. P_dj] and Gamma'_j = [P_0j .. P_kj, P_(k+1)i .. P_di], k = floor(d / 2), as
// samples. False if these still cross, as the crossing lies far from the middle of a patch.
template <int D>
bool swap_halves(const Contour<D>& contour, int i, int j, Points<D>& first, Points<D>& second) {
    Points<D> p = contour[i].control, q = contour[j].control;
    for (int a = D / 2 + 1; a <= D; ++a) std::swap(p[a], q[a]);
    if (visit_crossings(p, q, [](int, int) { return true; })) return false;
    for (int k = 0; k <= D; ++k) {
        first[k] = apply<D>(kBasis<D>.vandermonde[k], p);
        second[k] = apply<D>(kBasis<D>.vandermonde[k], q);
    }
    return true;
}

// The polygons joined at their crossing, so that neither leaves the space that both have covered.
template <int D>
bool join_at_crossing(const Points<D>& p, const Points<D>& q, Points<D>& first, Points<D>& second) {
    return visit_crossings(p, q, [&](int a, int b) {
        const Vec2 u = p[a + 1] - p[a];
        const double from = cross(u, q[b] - p[a]), to = cross(u, q[b + 1] - p[a]);  // of opposite signs
        const Vec2 at = q[b] + (from / (from - to)) * (q[b + 1] - q[b]);
        first = joined_at<D>(p, a, q, b, at);
        second = joined_at<D>(q, b, p, a, at);
        return true;
    });
}

// Which of two patches that change successors will turn towards the filled side; -1 where they cross more than once.
template <int D>
int turning_inwards(const Contour<D>& contour, int i, int j) {
    const auto &p = contour[i].control, &q = contour[j].control;
    int crossings = 0, inner = -1;
    visit_crossings(p, q, [&](int a, int b) {
        inner = cross(p[a + 1] - p[a], q[b + 1] - q[b]) > 0 ? i : j;
        return ++crossings > 1;
    });
    return crossings == 1 ? inner : -1;
}

// Bounds for the samples of exchanged curves: the box of the old samples, with a margin for control polygons of curves
// that do not oscillate. Those of a folded patch leave it many times farther, which each exchange would pass on.
template <int D>
Box reachable_box(const Points<D>& p, const Points<D>& q) {
    Box box;
    double length = 0.0;
    for (const Points<D>* points : {&p, &q}) {
        for (int k = 0; k <= D; ++k) {
            box.add((*points)[k]);
            if (k > 0) length += norm((*points)[k] - (*points)[k - 1]);
        }
    }
    const double beyond = (freeform::kOscillation - 1.0) * length;
    box.add({box.x0 - beyond, box.y0 - beyond});
    box.add({box.x1 + beyond, box.y1 + beyond});
    return box;
}

// Gives i and j their new curves and exchanges their successors: the swapped halves, or where these cross or would cut
// an edge, the curves joined at their crossing. False, with nothing changed, where only the control polygons cross.
template <int D>
bool exchange(Contour<D>& contour, int i, int j) {
    const Patch<D>&a = contour[i], &b = contour[j];
    const auto kept_i = a.m, kept_j = b.m;
    const int after_i = a.next, after_j = b.next;
    const Points<D> p = contour.samples(i), q = contour.samples(j);
    const int before = num_hits(contour, i) + num_hits(contour, j);
    const Box near = reachable_box<D>(p, q);
    const auto apply_pair = [&](const Points<D>& first, const Points<D>& second) {
        const auto is_near = [&](Vec2 sample) { return near.holds(sample); };
        if (!std::all_of(first.begin(), first.end(), is_near) || !std::all_of(second.begin(), second.end(), is_near))
            return false;
        std::copy_n(first.begin(), D, contour[i].m.begin());
        std::copy_n(second.begin(), D, contour[j].m.begin());
        contour.keep_inside(i);
        contour.keep_inside(j);
        contour.link(i, after_j);
        contour.link(j, after_i);
        return num_hits(contour, i) + num_hits(contour, j) <= before;
    };
    Points<D> first, second;
    if (swap_halves(contour, i, j, first, second) && apply_pair(first, second)) return true;
    contour.link(i, after_i);
    contour.link(j, after_j);
    // Up to cubics the curve follows the joined samples; one of higher degree may overshoot the corner into an edge.
    if (join_at_crossing<D>(p, q, first, second) && (apply_pair(first, second) || D <= 3)) return true;
    if (join_at_crossing<D>(a.control, b.control, first, second) && apply_pair(first, second)) return true;
    contour[i].m = kept_i;
    contour[j].m = kept_j;
    contour.link(i, after_i);
    contour.link(j, after_j);
    return false;
}

}  // namespace ffseg::topology
