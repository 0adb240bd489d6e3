// Samples at rest that move on once more before the contour counts as converged: at the tip of a front in a passage of
// a few pixels its normal may point at a side.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>

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

// A resting stretch that could still advance this far between its samples is split instead.
constexpr double kUncovered = 2.0;
// A sample put back with more room ahead of it than this is moved on with more samples beside it.
constexpr double kHeldBack = 1.0;
// Where the front squeezes through a passage of a few pixels its samples lie no farther apart, or it turns by more than
// the angle with this cosine (45 degrees).
constexpr double kTipChord = 4.0, kTipTurn = 0.7;

// Does a sample that moves pass its neighbour, so that the curve would run back there?
inline bool passes(Vec2 from, Vec2 to, Vec2 neighbour) { return dot(neighbour - to, neighbour - from) <= 0; }

// The middle of a patch's chord: another one once the patch is split.
template <int D>
Vec2 middle(const Contour<D>& contour, int i) {
    return 0.5 * (contour[i].m[0] + contour.end(i));
}

// Has nothing at rest been moved on or split for this pixel yet? Each is tried once only, so that this ends.
template <int D>
bool first_try(Contour<D>& contour, Vec2 place) {
    return contour.memory.retried.insert(contour.field.pixel(place)).second;
}

// Where a sample at rest may move on to: straight ahead, where it was put back although there is room, or aslant, where
// its normal is blocked but there is room beside: at the mouth of a narrow passage it may point at its side.
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

// Moves sample k of patch i, which lies between `last` and the next one, the first way that is free. Where only the
// curve meets an edge there, `hindered` becomes the patch with too few samples to follow.
template <int D>
bool move_on(Contour<D>& contour, int i, int k, Vec2 last, Vec2 tangent, int& hindered) {
    Patch<D>& patch = contour[i];
    const Vec2 from = patch.m[k], after = k + 1 < D ? patch.m[k + 1] : contour.end(i), normal{tangent.y, -tangent.x};
    const bool shut = contour.field.blocked(from + kMarchStep * normal);  // mostly it is: no way straight ahead
    for (std::size_t at = shut ? kFirstAslant : 0; at < kWays.size(); ++at) {
        const Way& way = kWays[at];
        const Vec2 heading = way.turn.x * normal + way.turn.y * tangent, to = from + way.length * heading;
        if (contour.field.blocked(to) || colour_stops(contour, to) || passes(from, to, after) || passes(from, to, last))
            continue;
        if (reach(contour.field, from, heading, way.length, 0.0) < way.length) continue;
        if (contour.memory.retried.count(contour.field.pixel(to)) != 0) continue;
        patch.m[k] = to;
        const int meeting = meets_edge(contour, i) ? i : k == 0 && meets_edge(contour, patch.prev) ? patch.prev : -1;
        if (meeting < 0) {
            first_try(contour, to);
            return true;
        }
        patch.m[k] = from;
        hindered = meeting;
    }
    return false;
}

// Splits a patch at rest, if its halves are not so short that they are pruned.
template <int D>
bool split_finely(Contour<D>& contour, int i) {
    if (i < 0 || contour.length(i) <= 2 * D * kPruneSpacing || !first_try(contour, middle(contour, i))) return false;
    contour.wake(i);
    contour.split(i);
    return true;
}

// Moves the samples of a patch at rest on where the curve turns, as it does at the tip of a front in a passage of a few
// pixels; a curve that has too few samples to follow is split.
template <int D>
bool slide(Contour<D>& contour, int i) {
    Patch<D>& patch = contour[i];
    bool any = false;
    int hindered = -1;
    Points<D> points = contour.samples(i);
    for (int k = 0; k < D; ++k) {
        const double ahead = norm2(points[k + 1] - points[k]);
        const Vec2 last = k > 0 ? points[k - 1] : contour[patch.prev].m[D - 1];
        const double behind = norm2(points[k] - last);
        const bool is_tip = std::min(ahead, behind) <= kTipChord * kTipChord;
        if (!is_tip && k > 0) continue;  // the curve does not turn there
        const Vec2 leaving = apply<D>(kBasis<D>.slope[k], points);
        const Vec2 arriving = k > 0 ? leaving : apply<D>(kBasis<D>.slope[D], contour.samples(patch.prev));
        const double along = dot(leaving, arriving);
        if (!is_tip && along > 0 && along * along > kTipTurn * kTipTurn * norm2(leaving) * norm2(arriving)) continue;
        const Vec2 in = unit(leaving), tangent = unit(in + (k > 0 ? in : unit(arriving)));
        if (!move_on(contour, i, k, last, tangent, hindered)) continue;
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
