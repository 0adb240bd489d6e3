// The bounding-box filter over the patches (Section 3.4): which pairs are looked at for a flip.
#pragma once
#include "freeform/chain.hpp"

namespace ffseg::freeform {

// Patches ordered by the left side of their boxes. The order hardly changes in one iteration, so insertion is cheap; many
// new ones, which stand at the end, are sorted among themselves and merged.
template <int D>
void Chain<D>::sort_patches() {
    using Key = std::pair<double, int>;
    const auto before = [](const Key& a, const Key& b) { return a.first < b.first; };
    const std::size_t count = sorted_.size(), known = count - num_sorted_ < kFewNew ? count : num_sorted_;
    keys_.resize(count);
    for (std::size_t at = 0; at < count; ++at) keys_[at] = {pool_.box(sorted_[at]).x0, sorted_[at]};
    for (std::size_t at = 1; at < known; ++at) {
        if (!before(keys_[at], keys_[at - 1])) continue;
        const Key moving = keys_[at];
        std::size_t to = at;
        for (; to > 0 && before(moving, keys_[to - 1]); --to) keys_[to] = keys_[to - 1];
        keys_[to] = moving;
    }
    if (known < count) {
        const auto fresh = keys_.begin() + static_cast<std::ptrdiff_t>(known);
        std::stable_sort(fresh, keys_.end(), before);
        std::inplace_merge(keys_.begin(), fresh, keys_.end(), before);
    }
    for (std::size_t at = 0; at < count; ++at) sorted_[at] = keys_[at].second;
    num_sorted_ = count;
}

// Do two control polygons cross properly?
template <int D>
bool Chain<D>::polygons_cross(int i, int j) const {
    const auto &p = pool_[i].control, &q = pool_[j].control;
    for (int a = 0; a < D; ++a) {
        Box box;
        box.add(p[a]);
        box.add(p[a + 1]);
        if (!box.meets(pool_.box(j))) continue;
        for (int b = 0; b < D; ++b) {
            if (segments_cross(p[a], p[a + 1], q[b], q[b + 1])) return true;
        }
    }
    return false;
}

// Flips i and j if they cross, or says so when this iteration has had its share; pairs at rest and (in later rounds) pairs
// not touched by a flip cannot have changed.
template <int D>
bool Chain<D>::try_pair(int i, int j, bool only_touched) {
    const Patch<D>&a = pool_[i], &b = pool_[j];
    if (!a.alive || !b.alive || !(a.active || b.active)) return false;
    if (only_touched && !(a.touched || b.touched)) return false;
    if (a.next == j || b.next == i) return false;
    ++walked_;
    if (spent()) {
        unresolved_ = true;
        return true;
    }
    if (!polygons_cross(i, j)) return false;
    const bool done = flip(i, j, 0);
    unresolved_ = unresolved_ || !done;
    return done;
}

// The bounding-box filter over the sorted patches, in strips so that its time stays linear in their number.
template <int D>
bool Chain<D>::sweep(bool only_touched) {
    sort_patches();
    moving_.assign(static_cast<std::size_t>(pool_.size()), 0);
    for (const int i : active_) moving_[static_cast<std::size_t>(i)] = pool_[i].active;
    const std::size_t strips = std::max<std::size_t>(1, std::min(sorted_.size() / kStripPatches,
                                                                 static_cast<std::size_t>(field_.height()) / kStripHeight));
    const double scale = static_cast<double>(strips) / field_.height();
    strips_.resize(std::max(strips, strips_.size()));
    for (std::size_t at = 0; at < strips; ++at) strips_[at].reset(sorted_.size());
    const auto strip_of = [&](double y) {
        return static_cast<std::size_t>(std::clamp(y * scale, 0.0, static_cast<double>(strips - 1)));
    };
    for (const int i : sorted_) {
        const Box& box = pool_.box(i);
        const bool moving = moving_[static_cast<std::size_t>(i)] != 0;
        for (std::size_t at = strip_of(box.y0), last = strip_of(box.y1); at <= last; ++at) strips_[at].push(box, i, moving);
    }
    bool any = false;
    for (std::size_t at = 0; at < strips; ++at) {
        any |= strips_[at].each_meeting(
            [this](int i) { return std::array<int, 2>{pool_[i].prev, pool_[i].next}; },
            [this, only_touched](int i, int j) { return pool_.box(i).meets(pool_.box(j)) && try_pair(i, j, only_touched); });
    }
    return any;
}

// While few patches move, each is compared with all others; else the sorted sweep pays.
template <int D>
bool Chain<D>::flip_round(bool only_touched) {
    const std::size_t moving = active_.size();
    if (moving > kFewActive) return sweep(only_touched);
    bool any = false;
    const int count = pool_.size();
    for (std::size_t at = 0; at < moving; ++at) {
        const int i = active_[at], prev = pool_[i].prev, next = pool_[i].next;
        const Box box = pool_.box(i);
        for (int j = 0; j < count; ++j) {
            if (!(box.meets(pool_.box(j)) & (j != i) & (j != prev) & (j != next))) continue;
            if (!try_pair(i, j, only_touched)) continue;
            any = true;
            break;
        }
    }
    return any;
}

}  // namespace ffseg::freeform
