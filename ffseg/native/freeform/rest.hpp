// Which patches have come to rest, and the promise that none does in open ground: the test Algorithm 4 ends with.
#pragma once
#include <algorithm>
#include <cstring>

#include "freeform/chain.hpp"

namespace ffseg::freeform {

// Could the curve of a resting patch still advance between its samples?
template <int D>
template <bool kClosely>
bool Chain<D>::uncovered(int i) const {
    const Points points = pool_.samples(i);
    for (int k = 0; k < D; ++k) {
        if (open_ahead<kClosely>(points, k)) return true;
    }
    return false;
}

// Is there room ahead of a place between samples k and k + 1? Several are looked at side by side, a step farther along
// their normals as long as one of them is free; once more closely, at places between those.
template <int D>
template <bool kClosely>
bool Chain<D>::open_ahead(const Points& points, int k) const {
    constexpr int kSub = Basis<D>::kSub, kSteps = static_cast<int>(kUncovered / kMarchStep);
    const double chord = norm(points[k + 1] - points[k]);
    if (chord < (kClosely ? kSub * kCloseLook : 2 * kMinSpacing)) return false;
    const int apart = chord <= 3.0 ? 4 : chord <= 6.0 ? 2 : 1;
    const int pieces = kClosely ? static_cast<int>(std::ceil(chord / (kSub * kCloseLook))) : 1;
    const Places<D> first(kBasis<D>.looks[k], points), stride(kBasis<D>.strides[k], points);
    Places<D> along(kBasis<D>.headings[k], points);
    std::array<bool, kSub> wanted{};
    std::array<float, kSub> dx, dy, size;
    std::memcpy(dx.data(), &along.x, sizeof dx);
    std::memcpy(dy.data(), &along.y, sizeof dy);
    for (int j = 0; j < kSub; ++j) {  // side by side
        size[j] = std::sqrt(dx[j] * dx[j] + dy[j] * dy[j]);
        dx[j] = dx[j] * static_cast<float>(kMarchStep) / size[j];
        dy[j] = dy[j] * static_cast<float>(kMarchStep) / size[j];
    }
    std::memcpy(&along.x, dx.data(), sizeof dx);
    std::memcpy(&along.y, dy.data(), sizeof dy);
    for (int j = 0; j < kSub; j += apart) wanted[j] = size[j] > 0;
    for (int piece = kClosely ? 1 : 0; piece < pieces; ++piece) {
        const float u = static_cast<float>(piece) / static_cast<float>(pieces);
        Places<D> at = first;
        for (int q = 0; q < Places<D>::kFours; ++q) {
            at.x[q] = at.x[q] + stride.x[q] * u;
            at.y[q] = at.y[q] + stride.y[q] * u;
        }
        std::array<bool, kSub> free = wanted;
        free[0] = free[0] && piece > 0;  // the first is a sample
        bool any = true;
        for (int step = 0; step <= kSteps && any; ++step) {
            any = false;
            for (int q = 0; q < Places<D>::kFours; ++q) {
                const auto cells = field_.cells(at.x[q], at.y[q]);
                for (int j = 0; j < 4; ++j) {
                    free[4 * q + j] &= !field_.blocked(cells[j]);
                    any |= free[4 * q + j];
                }
                at.x[q] = at.x[q] + along.y[q];
                at.y[q] = at.y[q] - along.x[q];
            }
        }
        if (any) return true;
    }
    return false;
}

// Is the nearest blocked pixel farther from p, which nothing stops along the normal, than an edge band is wide?
inline bool in_the_open(const Field& field, Vec2 p) {
    return !field.blocked_within(p, 1) && !field.blocked_within(p, kBandWidth);  // mostly it is the next one
}

// Moves samples at rest aslant where their normals are blocked but there is room beside: at the mouth of a narrow passage
// the normal may point at its side. To each pixel only once, so that it ends.
template <int D>
bool Chain<D>::slide(int i) {
    static constexpr std::array<Vec2, 4> kAslant{{{0.866, 0.5}, {0.866, -0.5}, {0.5, 0.866}, {0.5, -0.866}}};  // 30 and 60 degrees
    Patch<D>& patch = pool_[i];
    bool any = false;
    for (int k = 0; k < D; ++k) {
        const Points points = pool_.samples(i);
        const double ahead = norm2(points[k + 1] - points[k]);
        const double behind = norm2(points[k] - (k > 0 ? points[k - 1] : pool_[patch.prev].m[D - 1]));
        const bool is_tip = std::min(ahead, behind) <= kTipChord * kTipChord;
        const Vec2 slope = apply<D>(kBasis<D>.slope[k], points);
        if (!is_tip && k > 0 && norm2(slope) > 0) continue;
        const Vec2 leaving = unit(slope);
        const Vec2 arriving = k > 0 ? leaving : unit(apply<D>(kBasis<D>.slope[D], pool_.samples(patch.prev)));
        if (!is_tip && dot(leaving, arriving) > kTipTurn) continue;
        const Vec2 tangent = unit(leaving + arriving), normal{tangent.y, -tangent.x};
        for (const Vec2 turn : kAslant) {
            const Vec2 way = turn.x * normal + turn.y * tangent;
            const Vec2 to = points[k] + kUncovered * way;
            if (field_.blocked(to) || reach(points[k], way, kUncovered, 0.0) < kUncovered) continue;
            if (!retried_.insert(field_.pixel(to)).second) continue;
            const auto kept = patch.m[k];
            patch.m[k] = to;
            if (meets_edge(i) || (k == 0 && meets_edge(patch.prev))) {
                patch.m[k] = kept;
                continue;
            }
            any = true;
            break;
        }
    }
    if (!any) return false;
    patch.before = patch.m;
    pool_.refresh(i);
    pool_.refresh(patch.prev);
    wake(patch.prev);
    wake(i);
    return true;
}

// Was a sample of a patch at rest put back although there is room ahead of it?
template <int D>
bool Chain<D>::held_back(int i) const {
    const Patch<D>& patch = pool_[i];
    if (patch.reverted == 0) return false;
    const Points points = pool_.samples(i);
    for (int k = 0; k < D; ++k) {
        if ((patch.reverted >> k & 1u) == 0) continue;
        const Vec2 tangent = unit(apply<D>(kBasis<D>.slope[k], points));
        if (reach(points[k], {tangent.y, -tangent.x}, kHeldBack, 0.0) >= kHeldBack) return true;
    }
    return false;
}

// Has every sample something that blocks it within the width of an edge band?
template <int D>
bool Chain<D>::all_held() const {
    return std::all_of(sorted_.begin(), sorted_.end(), [this](int i) {
        const auto& samples = pool_[i].m;
        return std::none_of(samples.begin(), samples.end(), [this](Vec2 p) { return in_the_open(field_, p); });
    });
}

// Before the contour counts as converged every patch at rest is looked at closely: where it could still advance it is
// woken with all its repairs. Says whether any was. A place is tried once only, so that this ends; a sample that lies in
// the open even so is counted.
template <int D>
bool Chain<D>::wake_open() {
    num_stray_ = 0;
    const std::size_t count = sorted_.size();
    for (std::size_t at = 0; at < count; ++at) {
        const int i = sorted_[at];
        if (!pool_[i].alive || pool_[i].examined) continue;
        const auto& samples = pool_[i].m;
        const auto stray = std::find_if(samples.begin(), samples.end(), [this](Vec2 p) { return in_the_open(field_, p); });
        const bool open = stray != samples.end();
        num_stray_ += open;
        const bool ahead = open || (splittable(i) && (pool_[i].starved || held_back(i) || uncovered<true>(i)));
        if (ahead && retried_.insert(field_.pixel(open ? *stray : samples[0])).second) {
            pool_[i].budget = kSplitBudget;
            pool_[i].calmed = 0;
            wake(i);
            if (splittable(i)) split(i);
        } else if (!slide(i)) {
            pool_[i].examined = !open;
        }
    }
    return !active_.empty();
}

// Patches whose samples are all steady leave the loop, unless the edge map between their samples is still open.
template <int D>
void Chain<D>::rest() {
    const std::size_t count = active_.size();
    for (std::size_t at = 0; at < count; ++at) {
        const int i = active_[at];
        const Patch<D>& patch = pool_[i];
        if (!patch.alive || patch.steady != kAllSteady) continue;
        const Patch<D>& next = pool_[patch.next];
        if (next.active && (next.steady & 1u) == 0) continue;
        pool_[i].starved = options_.refine && splittable(i) && uncovered<false>(i);
        if (pool_[i].starved && pool_[i].budget > 0) {
            --pool_[i].budget;
            pool_[i].steady = 0;
            const int fresh = split(i);
            pool_[fresh].steady = 0;
            continue;
        }
        pool_[i].active = false;
    }
}

}  // namespace ffseg::freeform
