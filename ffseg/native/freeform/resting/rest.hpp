// Patches come to rest, but none in open space: the test with which Algorithm 4 ends.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "freeform/resting/slide.hpp"

namespace ffseg::resting {

using freeform::Basis;
using freeform::kAllSteady;
using freeform::kMinSpacing;
using freeform::Places;
using freeform::Spread;

// Pixels between the points that are tested once more before the contour counts as converged: an open gap is at least
// two by two pixels large.
constexpr double kCloseTest = 1.0;
// Pixels: width of an edge with the band on both sides.
constexpr int kBandWidth = 3;

// Do the colours let the front advance to any of these points?
template <int D>
bool any_unstopped(const Contour<D>& contour, const Places<D>& at, const std::array<bool, Basis<D>::kSub>& wanted) {
    for (std::size_t j = 0; j < wanted.size(); ++j) {
        if (wanted[j] && !colour_stops(contour, {at.x[j / 4][j % 4], at.y[j / 4][j % 4]})) return true;
    }
    return false;
}

// Is there free space ahead of the curve between samples k and k + 1? Several points are tested together, one step
// farther along their normals while any of them is free; in the close test, at points between these as well.
template <bool kClosely, int D>
bool interval_can_advance(const Contour<D>& contour, const Spread<D>& points, int k, double chord) {
    constexpr int kSub = Basis<D>::kSub, kSteps = static_cast<int>(kUncovered / kMarchStep);
    const int apart = chord <= 3.0 ? 4 : chord <= 6.0 ? 2 : 1;
    const int pieces = kClosely ? static_cast<int>(std::ceil(chord / (kSub * kCloseTest))) : 1;
    const Places<D> first(kBasis<D>.places[k], points);
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
        Places<D> at = first;
        if constexpr (kClosely) {
            const Places<D> stride(kBasis<D>.strides[k], points);
            const float u = static_cast<float>(piece) / static_cast<float>(pieces);
            for (int q = 0; q < Places<D>::kFours; ++q) {
                at.x[q] = at.x[q] + stride.x[q] * u;
                at.y[q] = at.y[q] + stride.y[q] * u;
            }
        }
        std::array<bool, kSub> free = wanted;
        free[0] = free[0] && piece > 0;  // the first is a sample
        bool any = true;
        for (int step = 0; step <= kSteps && any; ++step) {
            any = false;
            for (int q = 0; q < Places<D>::kFours; ++q) {
                const auto cells = contour.field.cells(at.x[q], at.y[q]);
                for (int j = 0; j < 4; ++j) {
                    free[4 * q + j] &= !contour.field.blocked(cells[j]);
                    any |= free[4 * q + j];
                }
                at.x[q] = at.x[q] + along.y[q];
                at.y[q] = at.y[q] - along.x[q];
            }
        }
        if (any && (contour.pressure == nullptr || any_unstopped(contour, at, free))) return true;
    }
    return false;
}

// Could the curve of a resting patch still advance between its samples?
template <bool kClosely, int D>
bool can_advance(const Contour<D>& contour, int i) {
    constexpr double kLeast = kClosely ? Basis<D>::kSub * kCloseTest : 2 * kMinSpacing;
    const Points<D> points = contour.samples(i);
    std::array<double, D> chord2;
    for (int k = 0; k < D; ++k) chord2[k] = norm2(points[k + 1] - points[k]);
    if (*std::max_element(chord2.begin(), chord2.end()) < kLeast * kLeast) return false;
    const Spread<D> spread(points);
    for (int k = 0; k < D; ++k) {
        if (chord2[k] >= kLeast * kLeast && interval_can_advance<kClosely>(contour, spread, k, std::sqrt(chord2[k])))
            return true;
    }
    return false;
}

// Does p lie in the open: farther from anything blocked than an edge band is wide, with no colour near it that stops
// the front?
template <int D>
bool in_the_open(const Contour<D>& contour, Vec2 p) {
    if (contour.field.blocked_beside(p) || contour.field.blocked_within(p, kBandWidth)) return false;  // mostly beside
    return contour.pressure == nullptr || !contour.pressure->stops_near(p);
}

// Was a sample of a resting patch put back although there is free space ahead of it?
template <int D>
bool held_back(const Contour<D>& contour, int i) {
    const Patch<D>& patch = contour[i];
    if (patch.reverted == 0) return false;
    const Points<D> points = contour.samples(i);
    for (int k = 0; k < D; ++k) {
        if ((patch.reverted >> k & 1u) == 0) continue;
        const Vec2 tangent = unit(apply<D>(kBasis<D>.slope[k], points));
        const Vec2 normal{tangent.y, -tangent.x};
        if (colour_stops(contour, points[k] + kHeldBack * normal)) continue;
        if (reach(contour.field, points[k], normal, kHeldBack, 0.0) >= kHeldBack) return true;
    }
    return false;
}

// Is every sample within the width of an edge band of something blocked?
template <int D>
bool all_held(const Contour<D>& contour) {
    return std::all_of(contour.order.begin(), contour.order.end(), [&](int i) {
        const auto& samples = contour[i].m;
        return std::none_of(samples.begin(), samples.end(), [&](Vec2 p) { return in_the_open(contour, p); });
    });
}

// The close test before the contour counts as converged: resting patches that could still advance are woken. True if
// any was. Each place is tried only once, so that the evolution ends; samples that stay in the open are counted.
template <int D>
bool wake_open(Contour<D>& contour) {
    contour.memory.num_stray = 0;
    const std::size_t count = contour.order.size();
    for (std::size_t at = 0; at < count; ++at) {
        const int i = contour.order[at];
        if (!contour[i].alive || contour[i].examined) continue;
        ++contour.effort.work;
        const auto& samples = contour[i].m;
        const auto stray =
            std::find_if(samples.begin(), samples.end(), [&](Vec2 p) { return in_the_open(contour, p); });
        const bool open = stray != samples.end();
        contour.memory.num_stray += open;
        const bool ahead = open || (contour.splittable(i) &&
                                    (contour[i].starved || held_back(contour, i) || can_advance<true>(contour, i)));
        if (ahead && first_try(contour, open ? *stray : middle(contour, i))) {
            contour[i].reductions = 0;
            contour.wake(i);
            if (contour.splittable(i)) contour.split(i);
        } else if (!slide(contour, i)) {
            contour[i].examined = !open;
        }
    }
    return !contour.active.empty();
}

// Patches whose samples are all steady come to rest, unless there is free space ahead between their samples.
template <int D>
void bring_to_rest(Contour<D>& contour) {
    const std::size_t count = contour.active.size();
    for (std::size_t at = 0; at < count; ++at) {
        const int i = contour.active[at];
        const Patch<D>& patch = contour[i];
        if (!patch.alive || patch.steady != kAllSteady<D>) continue;
        const Patch<D>& next = contour[patch.next];
        if (next.active && (next.steady & 1u) == 0) continue;
        contour[i].starved = contour.options.refine && contour.splittable(i) && can_advance<false>(contour, i);
        if (contour[i].starved && contour[i].budget > 0) {
            --contour[i].budget;
            contour[i].steady = 0;
            const int fresh = contour.split(i);
            contour[fresh].steady = 0;
            continue;
        }
        contour[i].active = false;
    }
}

}  // namespace ffseg::resting
