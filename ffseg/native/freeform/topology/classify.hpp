// Classification of the components that a flip has produced (Algorithm 3).
#pragma once
#include <cmath>

#include "freeform/topology/components.hpp"

namespace ffseg::topology {

// Square pixels: components enclosing less cannot hold the band round one edge pixel (3 x 3) and are dropped.
constexpr double kVoidArea = 4.0;
// Square pixels: where the front folds over itself at a corner it may cut off a negative loop that is no hole; such
// loops enclose less.
constexpr double kFoldArea = 64.0;
// The area of a component is not computed if it has this many times the patches of the one cut off from it.
constexpr int kLongComponent = 16;

// The result of a flip of two patches: one component, or two.
struct Parts {
    int small = -1, large = -1;  // a patch of the component with fewer patches and of the other; -1: they are one
    double area = 0.0;           // of the small one
    int patches = 0;             // upper bound for the small one
};

// Both are followed in step, at the cost of the shorter one.
template <int D>
Parts parts_after(const Contour<D>& contour, int i, int j) {
    const Vec2 origin = contour[i].m[0];
    double area_i = 0.0, area_j = 0.0;
    int at_i = i, at_j = j, patches = 0;
    for (;;) {
        ++patches;
        ++contour.effort.visits;
        area_i += patch_area(contour, at_i, origin);
        at_i = contour[at_i].next;
        if (at_i == j) return {};
        if (at_i == i) return {i, j, area_i, patches};
        area_j += patch_area(contour, at_j, origin);
        at_j = contour[at_j].next;
        if (at_j == i) return {};
        if (at_j == j) return {j, i, area_j, patches};
    }
}

// After a flip (Algorithm 3's inner and outer part): two components merged, or one was cut off. What bounds no region
// of positive winding number is dropped: a component of negligible area, and a positive one inside another (the front
// never re-enters what it has filled). `inner` is the patch whose component turns towards the filled side where the two
// crossed, so that the other one fills what lies round it there; -1 if unknown. Unless the contour is `simple`,
// crossings still to come may show a hole in a component, or that it owes a negligible area to two large lobes: it
// waits.
template <int D>
void classify(Contour<D>& contour, int i, int j, int inner, bool simple) {
    const auto [small, large, area, patches] = parts_after(contour, i, j);
    if (small < 0) {
        ++contour.counts.merges;
        return;
    }
    const auto drop_or_wait = [&, i, j](int component) {
        if (!simple && encloses_solid(contour, component)) {
            contour.undecided.emplace_back(i, j);
        } else {
            drop(contour, component);
        }
    };
    const double beside = component_area(contour, large, kLongComponent * patches);
    const bool is_void = std::abs(area) < kVoidArea;
    if (is_void) drop_or_wait(small);
    if (is_void || area < 0) {  // what a hole cuts off may lie in filled ground
        if (beside > 0 && std::isfinite(beside) && is_nested(contour, large)) drop_or_wait(large);
        return;
    }
    if (!simple && encloses_solid(contour, small)) {
        contour.undecided.emplace_back(i, j);
    } else if (std::isinf(beside) || beside <= 0) {
        const bool real = std::isinf(beside) || beside < -kFoldArea;  // larger than any fold of the front
        if ((real && small == inner) || is_nested(contour, small)) drop(contour, small);
    } else {
        const int within = area < beside ? small : large, outer = within == small ? large : small;
        if (contains(contour, outer, contour[within].m[0])) drop_or_wait(within);
    }
}

// Drops a loop of two or three patches, too few to cross itself, that has turned inside out without a flip: it would
// fill the ground round the former hole again. Not round an edge: one of two twisted lobes may still be a hole.
template <int D>
void drop_turned(Contour<D>& contour, int i) {
    const int third = contour[contour[i].next].next;
    if (!contour[i].alive || (third != i && third != contour[i].prev)) return;
    if (component_area(contour, i) > 0 && is_nested(contour, i) && !encloses_solid(contour, i)) drop(contour, i);
}

}  // namespace ffseg::topology
