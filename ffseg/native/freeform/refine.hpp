// Splitting patches that stretch (Algorithm 2) and pruning those that shrink or fold (the paper's footnote on pruning).
#pragma once
#include <limits>

#include "common/along.hpp"
#include "freeform/chain.hpp"

namespace ffseg::freeform {

// The paper's test: the largest distance between two control points of the patch.
template <int D>
bool Chain<D>::too_long(int i) const {
    const auto& p = pool_[i].control;
    const double limit = options_.split_threshold * options_.split_threshold;
    for (int a = 0; a < D; ++a) {
        for (int b = a + 1; b <= D; ++b) {
            if (norm2(p[b] - p[a]) > limit) return true;
        }
    }
    return false;
}

// Has the curve run over itself here: does a stretch between two samples point backwards after the move?
template <int D>
bool Chain<D>::folded(int i) const {
    const Patch<D>& patch = pool_[i];
    const Patch<D>& next = pool_[patch.next];
    const Vec2 end_before = next.active ? next.before[0] : next.m[0];
    for (int k = 0; k < D; ++k) {
        const Vec2 after = (k + 1 < D ? patch.m[k + 1] : next.m[0]) - patch.m[k];
        const Vec2 before = (k + 1 < D ? patch.before[k + 1] : end_before) - patch.before[k];
        if (dot(after, before) < 0) return true;
    }
    return false;
}

template <int D>
typename Chain<D>::Chords Chain<D>::chords(int i) const {
    const Points points = pool_.samples(i);
    Chords found{std::numeric_limits<double>::infinity(), 0.0, 0.0};
    for (int k = 0; k < D; ++k) {
        const double chord = norm(points[k + 1] - points[k]);
        found.shortest = std::min(found.shortest, chord);
        found.longest = std::max(found.longest, chord);
        found.total += chord;
    }
    return found;
}

// Replaces the patch by its chord, unless the chord meets an edge or an edge lies between it and the curve.
template <int D>
bool Chain<D>::straighten(int i) {
    Patch<D>& patch = pool_[i];
    const Points points = pool_.samples(i);
    if (patch.budget == 0 || (patch.crowded && field_.encloses_solid(points.data(), points.size()))) return false;
    const auto kept = patch.m;
    const Vec2 end = pool_.end(i);
    for (int k = 1; k < D; ++k) patch.m[k] = patch.m[0] + (static_cast<double>(k) / D) * (end - patch.m[0]);
    if (meets_edge(i)) {
        patch.m = kept;
        return false;
    }
    --patch.budget;
    ++counts_.prunes;
    return true;
}

// Takes patch i out; its neighbours meet at its middle, or at one of its ends where the middle would meet an edge.
template <int D>
bool Chain<D>::remove(int i) {
    const int prev = pool_[i].prev, next = pool_[i].next;
    if (prev == next || prev == i || pool_[next].next == prev) return false;
    const Vec2 start = pool_[i].m[0], end = pool_[next].m[0];
    pool_.link(prev, next);
    for (const Vec2 joint : {0.5 * (start + end), start, end}) {
        pool_[next].m[0] = joint;
        if (meets_edge(prev) || meets_edge(next)) continue;
        release(i);
        pool_[next].steady &= static_cast<std::uint8_t>(~1u);
        wake(prev);
        wake(next);
        pool_.refresh(prev);
        pool_.refresh(next);
        ++counts_.prunes;
        return true;
    }
    pool_[next].m[0] = end;
    pool_.link(prev, i);
    pool_.link(i, next);
    return false;
}

// Samples that have drawn together or apart let the curve swing between them; they are laid evenly along it again.
template <int D>
void Chain<D>::even_out(int i, const Chords& chords) {
    Patch<D>& patch = pool_[i];
    if (D == 1 || patch.budget == 0 || chords.longest <= kUneven * chords.shortest || chords.longest < 1.0) return;
    const Points points = pool_.samples(i);
    const auto kept = patch.m;
    Along along(points.data(), points.size(), false);
    for (int k = 1; k < D; ++k) patch.m[k] = along.at(along.length() * k / D);
    if (meets_edge(i)) {
        patch.m = kept;
    } else {
        --patch.budget;
        patch.steady &= 1u;
    }
}

// Is the control polygon much longer than the polygon of samples: does the curve swing about jittering samples?
template <int D>
bool Chain<D>::swings(int i, double size) const {
    const Patch<D>& patch = pool_[i];
    double polygon = 0.0, squares = 0.0;
    for (int k = 0; k < D; ++k) squares += norm2(patch.control[k + 1] - patch.control[k]);
    if (D * squares < 0.999 * kOscillation * kOscillation * size * size) return false;  // the mean is below the root mean square
    for (int k = 0; k < D; ++k) polygon += norm(patch.control[k + 1] - patch.control[k]);
    return polygon > kOscillation * size;
}

// Replaces the patch by the least-squares curve of lower degree through its samples, unless that meets an edge.
template <int D>
void Chain<D>::calm(int i) {
    Patch<D>& patch = pool_[i];
    const Points points = pool_.samples(i);
    const auto kept = patch.m;
    for (int k = 1; k < D; ++k) patch.m[k] = field_.clamp(apply<D>(kBasis<D>.reduced[k], points));
    if (meets_edge(i)) {
        patch.m = kept;
        patch.wants_split = true;
        return;
    }
    pool_.refresh(i);
}

// Has a loop of three patches, too few to cross itself, run over itself in this move? A hole that closes passes through
// its middle then, and would go on to do so for ever.
template <int D>
bool Chain<D>::passed_itself(int i) const {
    if (pool_[pool_[i].next].next != pool_[i].prev || !folded(i) || loop_area(i) > 0) return false;
    std::vector<Vec2> polygon;
    each_in_loop(i, [&](int at) { polygon.insert(polygon.end(), pool_[at].m.begin(), pool_[at].m.end()); });
    return !field_.encloses_solid(polygon.data(), polygon.size());
}

template <int D>
void Chain<D>::refine() {
    const std::size_t count = active_.size();  // patches made here were just measured
    for (std::size_t at = 0; at < count; ++at) {
        const int i = active_[at];
        Patch<D>& patch = pool_[i];
        if (!patch.alive) continue;
        if (passed_itself(i)) {
            drop(i);
            continue;
        }
        const Chords found = chords(i);
        const double size = found.total;
        const double shortest = patch.crowded ? D * kPruneSpacing : kPruneRatio * options_.split_threshold;
        if (size < shortest && remove(i)) continue;
        if (folded(i)) {
            const Vec2 chord = pool_.end(i) - patch.m[0];
            if (norm(chord) < 0.3 * size && remove(i)) continue;
            straighten(i);
        }
        if (patch.crowded) even_out(i, found);
        pool_.refresh(i);
        if (D > 2 && swings(i, found.total)) {
            calm(i);
            // Near edges it would swing out again and be calmed for ever: it needs more samples, or is held.
            if (patch.crowded && patch.calmed < kMostCalmed) ++patch.calmed;
            if (patch.calmed == kMostCalmed && patch.budget > 0 && splittable(i)) {
                patch.calmed = 0;
                patch.wants_split = true;
            } else if (patch.calmed == kMostCalmed) {
                patch.steady |= static_cast<std::uint8_t>(kAllSteady & ~1u);
            }
        }
        if (too_long(i) && (!pool_[i].crowded || pool_[i].budget > 0)) {
            if (pool_[i].crowded) --pool_[i].budget;
            split(i);
        } else if (pool_[i].wants_split && pool_[i].budget > 0 && splittable(i)) {
            --pool_[i].budget;
            const int after = pool_[split(i)].next;
            for (const int held : {i, after}) {  // samples put back may pass now
                pool_[held].steady &= static_cast<std::uint8_t>(~pool_[held].reverted);
                if (pool_[held].reverted != 0) wake(held);
            }
        }
        pool_[i].wants_split = false;
    }
}

}  // namespace ffseg::freeform
