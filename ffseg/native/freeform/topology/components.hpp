// Closed components of a contour: their area, what they enclose, and which of them bound the region.
#pragma once
#include <limits>
#include <vector>

#include "freeform/contour.hpp"

namespace ffseg::topology {

using freeform::Contour;
using freeform::Points;

// Testing this many bounding boxes costs as much as visiting one patch.
constexpr std::size_t kBoxesToAPatch = 8;

template <int D>
double patch_area(const Contour<D>& contour, int i, Vec2 origin) {
    const Points<D> points = contour.samples(i);
    double twice = 0.0;
    for (int k = 0; k < D; ++k) twice += cross(points[k] - origin, points[k + 1] - origin);
    return 0.5 * twice;
}

// The area of a loop's polygon of samples; infinity if it has more patches than this.
template <int D>
double component_area(const Contour<D>& contour, int i, int most = std::numeric_limits<int>::max()) {
    const Vec2 origin = contour[i].m[0];
    double area = 0.0;
    int at = i;
    do {
        ++contour.effort.visits;
        if (--most < 0) return std::numeric_limits<double>::infinity();
        area += patch_area(contour, at, origin);
        at = contour[at].next;
    } while (at != i);
    return area;
}

// Is p inside the polygon of samples of a loop (even-odd; it crosses itself only at flips in progress)?
template <int D>
bool contains(const Contour<D>& contour, int loop, Vec2 p) {
    bool inside = false;
    contour.each_in(loop, [&](int at) {
        const Points<D> points = contour.samples(at);
        ++contour.effort.visits;
        for (int k = 0; k < D; ++k) inside ^= passes_right_of(p, points[k], points[k + 1]);
    });
    return inside;
}

// From this many point-in-component queries in one iteration on, patches are indexed by rows: with thousands of loops
// each query would otherwise take time proportional to all of them.
constexpr std::size_t kManyAsked = 16;

template <int D>
void use_rows(Contour<D>& contour) {
    contour.rows.reset(contour.field.height());
    for (const int i : contour.order) contour.rows.add(i, contour.box(i));
    contour.rows.used = true;
}

// Does a positive loop lie in filled ground: is the winding number of the other loops there at least one?
template <int D>
bool is_nested(Contour<D>& contour, int loop) {
    auto& seen = contour.buffers.seen;
    seen.resize(static_cast<std::size_t>(contour.size()), 0);
    const int question = ++contour.buffers.question;
    contour.each_in(loop, [&](int at) { seen[static_cast<std::size_t>(at)] = question; });
    const Vec2 p = contour[loop].m[0];
    int winding = contour.outside_filled ? 1 : 0;
    contour.effort.visits += contour.order.size() / kBoxesToAPatch;
    if (++contour.effort.asked == kManyAsked) use_rows(contour);
    for (const int i : contour.rows.used ? contour.rows.at(p.y) : contour.order) {
        const Box& box = contour.box(i);
        if (!((box.y0 <= p.y) & (p.y <= box.y1) & (p.x <= box.x1))) continue;
        if (!contour[i].alive || seen[static_cast<std::size_t>(i)] == question) continue;
        seen[static_cast<std::size_t>(i)] = question;  // it may be listed again
        const Points<D> points = contour.samples(i);
        for (int k = 0; k < D; ++k) {
            if (passes_right_of(p, points[k], points[k + 1])) winding += points[k + 1].y > points[k].y ? 1 : -1;
        }
    }
    return winding >= 1;
}

template <int D>
bool encloses_solid(const Contour<D>& contour, int i) {
    std::vector<Vec2> polygon;
    contour.each_in(i, [&](int at) {
        ++contour.effort.visits;
        polygon.insert(polygon.end(), contour[at].m.begin(), contour[at].m.end());
    });
    return contour.field.encloses_solid(polygon.data(), polygon.size());
}

template <int D>
void drop(Contour<D>& contour, int i) {
    contour.each_in(i, [&](int at) { contour.retire(at); });
    ++contour.counts.drops;
}

}  // namespace ffseg::topology
