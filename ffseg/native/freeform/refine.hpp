// Splitting patches that stretch (Algorithm 2) and pruning those that shrink or fold (Section 3.3, footnote).
#pragma once
#include <limits>

#include "common/along.hpp"
#include "freeform/guard.hpp"
#include "freeform/topology/components.hpp"

namespace ffseg::freeform {

// Away from edges patches shorter than this fraction of the split threshold are pruned.
constexpr double kPruneRatio = 0.2;
// A patch is re-sampled evenly if its longest chord between samples exceeds its shortest by this factor.
constexpr double kUneven = 3.0;

// Renews the repairs of patches near edges that advance into a new tile, so at most once per tile: the evolution ends.
template <int D>
void renew_repairs(Contour<D>& contour) {
    for (const int i : contour.active) {
        Patch<D>& patch = contour[i];
        if (patch.budget > kSplitBudget / 2) continue;
        for (int k = 0; k < D; ++k) {
            std::uint8_t& tile = contour.memory.reached[contour.field.tile(patch.m[k])];
            if (tile == 0 && (patch.steady >> k & 1u) == 0) {
                tile = 1;
                patch.budget = kSplitBudget;
            }
        }
    }
}

// The paper's test: the largest distance between two control points of the patch.
template <int D>
bool too_long(const Contour<D>& contour, int i) {
    const auto& p = contour[i].control;
    const double limit = contour.options.split_threshold * contour.options.split_threshold;
    for (int a = 0; a < D; ++a) {
        for (int b = a + 1; b <= D; ++b) {
            if (norm2(p[b] - p[a]) > limit) return true;
        }
    }
    return false;
}

// Does the curve fold over itself: does an interval between two samples point backwards after the move?
template <int D>
FFSEG_INLINE bool folded(const Contour<D>& contour, int i) {
    const Patch<D>& patch = contour[i];
    const Patch<D>& next = contour[patch.next];
    const Vec2 end_before = next.active ? next.before[0] : next.m[0];
    for (int k = 0; k < D; ++k) {
        const Vec2 after = (k + 1 < D ? patch.m[k + 1] : next.m[0]) - patch.m[k];
        const Vec2 before = (k + 1 < D ? patch.before[k + 1] : end_before) - patch.before[k];
        if (dot(after, before) < 0) return true;
    }
    return false;
}

// Has a hole without an edge passed through itself: does each of its intervals point backwards after the move? It
// would cross nothing any more, and come back forever.
template <int D>
bool passed_itself(const Contour<D>& contour, int i) {
    int at = i;
    do {
        if (!folded(contour, at)) return false;
        at = contour[at].next;
    } while (at != i);
    return topology::component_area(contour, i) < 0 && !topology::encloses_solid(contour, i);
}

// Replaces the patch by its chord, unless the chord meets an edge, or an edge lies between chord and curve.
template <int D>
bool straighten(Contour<D>& contour, int i) {
    Patch<D>& patch = contour[i];
    const Points<D> points = contour.samples(i);
    if (patch.budget == 0 || (patch.near_edges && contour.field.encloses_solid(points.data(), points.size())))
        return false;
    const auto kept = patch.m;
    const Vec2 end = contour.end(i);
    for (int k = 1; k < D; ++k) patch.m[k] = patch.m[0] + (static_cast<double>(k) / D) * (end - patch.m[0]);
    if (meets_edge(contour, i)) {
        patch.m = kept;
        return false;
    }
    --patch.budget;
    ++contour.counts.prunes;
    return true;
}

// Removes patch i; its neighbours meet at its middle or, if they would meet an edge there, at one of its ends.
template <int D>
bool prune(Contour<D>& contour, int i) {
    const int prev = contour[i].prev, next = contour[i].next;
    if (prev == next || prev == i || contour[next].next == prev) return false;
    const Vec2 start = contour[i].m[0], end = contour[next].m[0];
    contour.link(prev, next);
    for (const Vec2 joint : {0.5 * (start + end), start, end}) {
        contour[next].m[0] = joint;
        if (meets_edge(contour, prev) || meets_edge(contour, next)) continue;
        contour.retire(i);
        contour[next].steady &= static_cast<std::uint8_t>(~1u);
        contour.wake(prev);
        contour.wake(next);
        contour.refresh(prev);
        contour.refresh(next);
        ++contour.counts.prunes;
        return true;
    }
    contour[next].m[0] = end;
    contour.link(prev, i);
    contour.link(i, next);
    return false;
}

// Re-samples the curve evenly: unevenly spaced samples let it oscillate between them.
template <int D>
FFSEG_INLINE void resample_evenly(Contour<D>& contour, int i, const Chords& chords) {
    Patch<D>& patch = contour[i];
    if (D == 1 || patch.budget == 0 || chords.longest <= kUneven * chords.shortest || chords.longest < 1.0) return;
    const Points<D> points = contour.samples(i);
    const auto kept = patch.m;
    Along along(points.data(), points.size(), false);
    for (int k = 1; k < D; ++k) patch.m[k] = along.at(along.length() * k / D);
    if (meets_edge(contour, i)) {
        patch.m = kept;
    } else {
        --patch.budget;
        patch.steady &= 1u;
    }
}

// Does the curve oscillate about jittering samples: is its control polygon much longer than the polygon of samples?
template <int D>
FFSEG_INLINE bool oscillates(const Contour<D>& contour, int i, double size) {
    const Patch<D>& patch = contour[i];
    double polygon = 0.0, squares = 0.0;
    for (int k = 0; k < D; ++k) squares += norm2(patch.control[k + 1] - patch.control[k]);
    if (D * squares < 0.999 * kOscillation * kOscillation * size * size)
        return false;  // the mean is below the root mean square
    for (int k = 0; k < D; ++k) polygon += norm(patch.control[k + 1] - patch.control[k]);
    return polygon > kOscillation * size;
}

// Replaces the patch by the least-squares curve of lower degree through its samples, unless that meets an edge.
template <int D>
void reduce_degree(Contour<D>& contour, int i) {
    Patch<D>& patch = contour[i];
    const Points<D> points = contour.samples(i);
    const auto kept = patch.m;
    for (int k = 1; k < D; ++k) patch.m[k] = contour.field.clamp(apply<D>(kBasis<D>.reduced[k], points));
    if (meets_edge(contour, i)) {
        patch.m = kept;
        patch.wants_split = true;
        return;
    }
    contour.refresh(i);
}

// Prunes a patch that has become short or folds over itself, or straightens the latter; drops a hole that has passed
// through itself. True if the patch is gone.
template <int D>
FFSEG_INLINE bool prune_short(Contour<D>& contour, int i, double size) {
    const Patch<D>& patch = contour[i];
    const double shortest = patch.near_edges ? D * kPruneSpacing : kPruneRatio * contour.options.split_threshold;
    if (size < shortest && prune(contour, i)) return true;
    if (!folded(contour, i)) return false;
    if (contour.options.topology && passed_itself(contour, i)) {
        topology::drop(contour, i);
        return true;
    }
    const Vec2 chord = contour.end(i) - patch.m[0];
    if (norm(chord) < 0.3 * size && prune(contour, i)) return true;
    straighten(contour, i);
    return false;
}

// Reduces the degree of a curve that oscillates. Near edges that would go on forever: there it is split, or held.
template <int D>
FFSEG_INLINE void damp(Contour<D>& contour, int i, double size) {
    if (D <= 2 || !oscillates(contour, i, size)) return;
    reduce_degree(contour, i);
    Patch<D>& patch = contour[i];
    if (patch.near_edges && patch.reductions < kMaxReductions) ++patch.reductions;
    if (patch.reductions < kMaxReductions) return;
    if (patch.budget > 0 && contour.splittable(i)) {
        patch.reductions = 0;
        patch.wants_split = true;
    } else {
        patch.steady |= static_cast<std::uint8_t>(kAllSteady<D> & ~1u);
    }
}

// Splits a patch that is too long (Algorithm 2) or stopped by an edge: with more samples it may pass.
template <int D>
FFSEG_INLINE void split_if_needed(Contour<D>& contour, int i) {
    const Patch<D>& patch = contour[i];
    if (too_long(contour, i) && (!patch.near_edges || patch.budget > 0)) {
        if (patch.near_edges) --contour[i].budget;
        contour.split(i);
    } else if (patch.wants_split && patch.budget > 0 && contour.splittable(i)) {
        --contour[i].budget;
        const int after = contour[contour.split(i)].next;
        for (const int held : {i, after}) {
            contour[held].steady &= static_cast<std::uint8_t>(~contour[held].reverted);
            if (contour[held].reverted != 0) contour.wake(held);
        }
    }
    contour[i].wants_split = false;
}

// Algorithm 2 with pruning: patches that moved are split, pruned and repaired, so that samples stay evenly spaced.
template <int D>
void split_and_prune(Contour<D>& contour) {
    if (!contour.options.refine) {
        for (int i : contour.active) contour.refresh(i);
        return;
    }
    renew_repairs(contour);
    const std::size_t count = contour.active.size();  // new patches were just tested
    for (std::size_t at = 0; at < count; ++at) {
        const int i = contour.active[at];
        if (!contour[i].alive) continue;
        const Chords found = contour.chords(i);
        if (prune_short(contour, i, found.total)) continue;
        if (contour[i].near_edges) resample_evenly(contour, i, found);
        contour.refresh(i);
        damp(contour, i, found.total);
        split_if_needed(contour, i);
    }
}

}  // namespace ffseg::freeform
