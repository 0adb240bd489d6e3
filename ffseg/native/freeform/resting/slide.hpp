// Resting samples that advance once more before the contour counts as converged: at the tip of a front in a passage a
// few pixels wide, the normal may point at a side.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "freeform/guard.hpp"

namespace ffseg::resting {

using freeform::apply;
using freeform::Contour;
using freeform::kBasis;
using freeform::kMarchStep;
using freeform::kPruneSpacing;
using freeform::Patch;
using freeform::Points;
using freeform::reach;

// Pixels: a resting patch that could still advance this far between its samples is split instead.
constexpr double kUncovered = 2.0;
// Pixels: a sample put back with more free space than this ahead advances again, with more samples beside it.
constexpr double kHeldBack = 1.0;
// Pixels and a cosine (45 degrees): in a passage a few pixels wide the front is a tip, with samples this near to each
// other or a turn of more than that angle; at the very end it turns back.
constexpr double kTipChord = 4.0, kTipTurn = 0.7;

// Does a moving sample pass its neighbour, so that the curve would run backwards there?
inline bool passes(Vec2 from, Vec2 to, Vec2 neighbour) { return dot(neighbour - to, neighbour - from) <= 0; }

// Does the curve turn here as at a tip?
inline bool turns(Vec2 arriving, Vec2 leaving) {
    const double along = dot(arriving, leaving);
    return along <= 0 || along * along <= kTipTurn * kTipTurn * norm2(arriving) * norm2(leaving);
}

// The middle of a patch's chord, which changes when the patch is split.
template <int D>
Vec2 middle(const Contour<D>& contour, int i) {
    return 0.5 * (contour[i].m[0] + contour.end(i));
}

// Is this pixel tried for the first time? Each is tried only once, so that the evolution ends.
template <int D>
bool first_try(Contour<D>& contour, Vec2 place) {
    return contour.memory.retried.insert(contour.field.pixel(place)).second;
}

// Directions in which a resting sample may advance: straight ahead, if it was put back despite free space, or
// obliquely, if its normal is blocked: at the mouth of a narrow passage it may point at its side.
struct Way {
    Vec2 turn;  // along the normal and the tangent
    double length;
};
constexpr std::array<Way, 6> kWays{{{{1.0, 0.0}, kUncovered},
                                    {{1.0, 0.0}, kHeldBack},
                                    {{0.866, 0.5}, kUncovered},  // 30 and 60 degrees
                                    {{0.866, -0.5}, kUncovered},
                                    {{0.5, 0.866}, kUncovered},
                                    {{0.5, -0.866}, kUncovered}}};
constexpr std::size_t kFirstAslant = 2;
// The cosine between a step to the next pixel and the way ahead must exceed this: a slide may go sideways, round the
// corners of free space.
constexpr double kSideways = -0.75;

// A sample that may advance, and the one before it.
struct Resting {
    int patch, k;
    Vec2 last;
};

// Moves a sample along a direction, if it is free. If only the curve meets an edge then, `hindered` becomes the patch
// with too few samples to follow.
template <int D>
bool try_way(Contour<D>& contour, const Resting& at, Vec2 heading, double length, int& hindered) {
    Patch<D>& patch = contour[at.patch];
    const Vec2 from = patch.m[at.k], after = at.k + 1 < D ? patch.m[at.k + 1] : contour.end(at.patch);
    const Vec2 to = from + length * heading;
    if (contour.field.blocked(to) || colour_stops(contour, to) || passes(from, to, after) || passes(from, to, at.last))
        return false;
    if (reach(contour.field, from, heading, length, 0.0) < length) return false;
    if (contour.memory.retried.count(contour.field.pixel(to)) != 0) return false;
    patch.m[at.k] = to;
    const int meeting = meets_edge(contour, at.patch)                  ? at.patch
                        : at.k == 0 && meets_edge(contour, patch.prev) ? patch.prev
                                                                       : -1;
    if (meeting < 0) {
        first_try(contour, to);
        return true;
    }
    patch.m[at.k] = from;
    hindered = meeting;
    return false;
}

// Moves a sample in the first direction that is free.
template <int D>
bool move_on(Contour<D>& contour, const Resting& at, Vec2 tangent, int& hindered) {
    const Vec2 from = contour[at.patch].m[at.k], normal{tangent.y, -tangent.x};
    const bool shut = contour.field.blocked(from + kMarchStep * normal);  // mostly: not straight ahead
    for (std::size_t way = shut ? kFirstAslant : 0; way < kWays.size(); ++way) {
        const Vec2 heading = kWays[way].turn.x * normal + kWays[way].turn.y * tangent;
        if (try_way(contour, at, heading, kWays[way].length, hindered)) return true;
    }
    return false;
}

// Calls visit(centre) for each pixel beside p until one returns true; true if so.
template <typename Visit>
bool visit_beside(Vec2 p, Visit visit) {
    for (const double dy : {-1.0, 0.0, 1.0}) {
        for (const double dx : {-1.0, 0.0, 1.0}) {
            if ((dx != 0 || dy != 0) && visit(Vec2{std::floor(p.x + 0.5) + dx, std::floor(p.y + 0.5) + dy}))
                return true;
        }
    }
    return false;
}

// Moves a sample at which the curve turns back to the centre of a neighbouring pixel, the one farthest ahead first, if
// free space continues there: an oblique passage leads from pixel to pixel, sometimes sideways, where no straight step
// stays inside it.
template <int D>
bool move_to_pixel(Contour<D>& contour, const Resting& at, Vec2 next, int& hindered) {
    const Vec2 from = contour[at.patch].m[at.k], ahead = unit(unit(from - at.last) + unit(from - next));
    const auto gets_on = [&](Vec2 p) { return dot(p - from, ahead) > 0 && !contour.field.blocked(p); };
    std::array<std::pair<double, Vec2>, 8> ways;
    std::size_t count = 0;
    visit_beside(from, [&](Vec2 to) {
        const double along = dot(unit(to - from), ahead);
        if (along > kSideways && !contour.field.blocked(to) && (gets_on(to) || visit_beside(to, gets_on))) {
            ways[count++] = {along, to - from};
        }
        return false;
    });
    const auto end = ways.begin() + static_cast<std::ptrdiff_t>(count);
    std::stable_sort(ways.begin(), end, [](const auto& a, const auto& b) { return a.first > b.first; });
    return std::any_of(ways.begin(), end, [&](const auto& way) {
        return try_way(contour, at, unit(way.second), norm(way.second), hindered);
    });
}

// Splits a resting patch, unless its halves would be pruned.
template <int D>
bool split_finely(Contour<D>& contour, int i) {
    if (i < 0 || contour.length(i) <= 2 * D * kPruneSpacing || !first_try(contour, middle(contour, i))) return false;
    contour.wake(i);
    contour.split(i);
    return true;
}

// Advances samples of a resting patch where the curve turns, as at the tip of a front in a passage a few pixels wide; a
// curve with too few samples to follow is split.
template <int D>
bool slide(Contour<D>& contour, int i) {
    Patch<D>& patch = contour[i];
    bool any = false;
    int hindered = -1;
    Points<D> points = contour.samples(i);
    for (int k = 0; k < D; ++k) {
        const Vec2 last = k > 0 ? points[k - 1] : contour[patch.prev].m[D - 1];
        const Vec2 behind = points[k] - last, ahead = points[k + 1] - points[k];
        const bool is_tip = std::min(norm2(ahead), norm2(behind)) <= kTipChord * kTipChord;
        // With the opposite turn it is the corner of a hole, which points into filled ground.
        const bool turns_back = dot(behind, ahead) < 0 && cross(behind, ahead) > 0;
        if (!is_tip && !turns_back && k > 0) continue;  // the curve does not turn there
        const Vec2 leaving = apply<D>(kBasis<D>.slope[k], points);
        const Vec2 arriving = k > 0 ? leaving : apply<D>(kBasis<D>.slope[D], contour.samples(patch.prev));
        if (!is_tip && !turns_back && !turns(arriving, leaving)) continue;
        const Vec2 in = unit(leaving), tangent = unit(in + (k > 0 ? in : unit(arriving)));
        const Resting at{i, k, last};
        if (!move_on(contour, at, tangent, hindered) &&
            !(turns_back && move_to_pixel(contour, at, points[k + 1], hindered))) {
            continue;
        }
        points[k] = patch.m[k];
        any = true;
    }
    if (!any) return split_finely(contour, hindered);
    patch.before = patch.m;
    contour.refresh(i);
    contour.refresh(patch.prev);
    contour.wake(patch.prev);
    contour.wake(i);
    return true;
}

}  // namespace ffseg::resting
