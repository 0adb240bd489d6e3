// Closed components: which of them bound the region after a flip has cut or joined them.
#pragma once
#include "freeform/chain.hpp"

namespace ffseg::freeform {

// Calls visit(patch) for those of a loop in order.
template <int D>
template <typename Visit>
void Chain<D>::each_in_loop(int loop, Visit visit) const {
    int at = loop;
    do {
        const int next = pool_[at].next;
        visit(at);
        at = next;
    } while (at != loop);
}

template <int D>
double Chain<D>::patch_area(int i, Vec2 origin) const {
    const Points points = pool_.samples(i);
    double twice = 0.0;
    for (int k = 0; k < D; ++k) twice += cross(points[k] - origin, points[k + 1] - origin);
    return 0.5 * twice;
}

// The area of the polygon of samples of a loop of at most so many patches, else infinity.
template <int D>
double Chain<D>::loop_area(int i, int most) const {
    const Vec2 origin = pool_[i].m[0];
    double area = 0.0;
    int at = i;
    do {
        ++walked_;
        if (--most < 0) return std::numeric_limits<double>::infinity();
        area += patch_area(at, origin);
        at = pool_[at].next;
    } while (at != i);
    return area;
}

// Is p inside the polygon of samples of a loop (even-odd; the loop does not cross itself but at flips under way)?
template <int D>
bool Chain<D>::loop_contains(int loop, Vec2 p) const {
    bool inside = false;
    each_in_loop(loop, [&](int at) {
        const Points points = pool_.samples(at);
        ++walked_;
        for (int k = 0; k < D; ++k) inside ^= passes_right_of(p, points[k], points[k + 1]);
    });
    return inside;
}

// Does a positive loop lie in what the others have filled: is their winding number there one or more?
template <int D>
bool Chain<D>::nested(int loop) {
    own_.assign(static_cast<std::size_t>(pool_.size()), 0);
    each_in_loop(loop, [this](int at) { own_[static_cast<std::size_t>(at)] = 1; });
    const Vec2 p = pool_[loop].m[0];
    int winding = outside_filled_ ? 1 : 0;
    walked_ += sorted_.size() / kBoxesToAPatch;
    for (const int i : sorted_) {
        const Box& box = pool_.box(i);
        if (!((box.y0 <= p.y) & (p.y <= box.y1) & (p.x <= box.x1))) continue;
        if (!pool_[i].alive || own_[static_cast<std::size_t>(i)] != 0) continue;
        const Points points = pool_.samples(i);
        for (int k = 0; k < D; ++k) {
            if (passes_right_of(p, points[k], points[k + 1])) winding += points[k + 1].y > points[k].y ? 1 : -1;
        }
    }
    return winding >= 1;
}

template <int D>
bool Chain<D>::loop_encloses_solid(int i) const {
    std::vector<Vec2> polygon;
    each_in_loop(i, [&](int at) {
        ++walked_;
        polygon.insert(polygon.end(), pool_[at].m.begin(), pool_[at].m.end());
    });
    return field_.encloses_solid(polygon.data(), polygon.size());
}

template <int D>
void Chain<D>::drop(int i) {
    each_in_loop(i, [this](int at) { release(at); });
    ++counts_.drops;
}

// After a flip: one loop (two components merged) or two (one was cut off)? Both are walked in step, so the cost is that
// of the shorter one. What bounds no region of positive winding number is dropped: a component of negligible area, and a
// positive one inside another (the front never re-enters what it has filled). `inner` is the patch whose loop turns
// towards the filled side where the two crossed, so that the other one fills what lies round it there; -1 if unknown.
template <int D>
void Chain<D>::classify(int i, int j, int inner, bool simple) {
    const Vec2 origin = pool_[i].m[0];
    double area_i = 0.0, area_j = 0.0;
    int at_i = i, at_j = j, small = -1, large = -1, walked = 0;
    while (small < 0) {
        ++walked;
        ++walked_;
        area_i += patch_area(at_i, origin);
        at_i = pool_[at_i].next;
        if (at_i == j) {
            ++counts_.merges;
            return;
        }
        if (at_i == i) {
            small = i;
            large = j;
            break;
        }
        area_j += patch_area(at_j, origin);
        at_j = pool_[at_j].next;
        if (at_j == i) {
            ++counts_.merges;
            return;
        }
        if (at_j == j) {
            small = j;
            large = i;
        }
    }
    const double area = small == i ? area_i : area_j;
    // Crossings still to come may show a hole in a loop, or that it owes a negligible area to two large lobes.
    const auto drop_or_wait = [&](int loop) {
        if (!simple && loop_encloses_solid(loop)) {
            undecided_.emplace_back(i, j);
        } else {
            drop(loop);
        }
    };
    if (std::abs(area) < kVoidArea) return drop_or_wait(small);
    const double beside = loop_area(large, kLongWalk * walked);
    if (area < 0) {  // a hole; what it cuts off beside it may lie in what is filled already
        if (beside > 0 && std::isfinite(beside) && nested(large)) drop_or_wait(large);
        return;
    }
    if (!simple && loop_encloses_solid(small)) {
        undecided_.emplace_back(i, j);
    } else if (std::isinf(beside) || beside <= 0) {
        const bool real = std::isinf(beside) || beside < -kFoldArea;  // no fold of the front is so large
        if ((real && small == inner) || nested(small)) drop(small);
    } else {
        const int within = area < beside ? small : large, outer = within == small ? large : small;
        if (loop_contains(outer, pool_[within].m[0])) drop_or_wait(within);
    }
}

// At the end: a component is kept where it bounds the region, that is where the winding number of the larger ones kept
// is 0 outside an outer component and 1 outside a hole.
template <int D>
void Chain<D>::drop_nested() {
    struct Loop {
        int first;
        double area;
        Box box;
    };
    std::vector<Loop> found;
    for (int loop : loops()) {
        Loop entry{loop, loop_area(loop), {}};
        each_in_loop(loop, [&](int at) {
            for (const Vec2 p : pool_[at].m) entry.box.add(p);
        });
        found.push_back(entry);
    }
    std::stable_sort(found.begin(), found.end(),
                     [](const Loop& a, const Loop& b) { return std::abs(a.area) > std::abs(b.area); });
    std::vector<Loop> kept;
    for (const Loop& loop : found) {
        const Vec2 p = pool_[loop.first].m[0];
        int winding = outside_filled_ ? 1 : 0;
        for (const Loop& other : kept) {
            if (other.box.holds(p) && loop_contains(other.first, p)) winding += other.area > 0 ? 1 : -1;
        }
        if (winding == (loop.area > 0 ? 0 : 1)) {
            kept.push_back(loop);
        } else {
            drop(loop.first);
        }
    }
}

}  // namespace ffseg::freeform
