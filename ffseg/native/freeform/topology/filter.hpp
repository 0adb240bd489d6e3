// The bounding-box filter over the patches (Section 3.4), which finds the pairs to test for a flip.
#pragma once
#include <algorithm>
#include <array>
#include <utility>

#include "freeform/contour.hpp"

namespace ffseg::topology {

using freeform::Contour;

// Patches per strip of the sweep filter, and smallest strip height in pixels, so that most patches lie in one strip.
constexpr std::size_t kStripPatches = 256;
constexpr std::size_t kStripHeight = 64;
// If more patches than this are new, they are sorted among themselves before they are merged with the others.
constexpr std::size_t kFewNew = 16;

// Patches sorted by the left sides of their boxes. The order hardly changes in one iteration, so insertion is cheap;
// many new ones, at the end, are sorted among themselves and merged.
template <int D>
void sort_patches(Contour<D>& contour) {
    using Key = std::pair<double, int>;
    const auto before = [](const Key& a, const Key& b) { return a.first < b.first; };
    const std::size_t count = contour.order.size(),
                      known = count - contour.num_ordered < kFewNew ? count : contour.num_ordered;
    contour.buffers.keys.resize(count);
    for (std::size_t at = 0; at < count; ++at)
        contour.buffers.keys[at] = {contour.box(contour.order[at]).x0, contour.order[at]};
    for (std::size_t at = 1; at < known; ++at) {
        if (!before(contour.buffers.keys[at], contour.buffers.keys[at - 1])) continue;
        const Key moving = contour.buffers.keys[at];
        std::size_t to = at;
        for (; to > 0 && before(moving, contour.buffers.keys[to - 1]); --to)
            contour.buffers.keys[to] = contour.buffers.keys[to - 1];
        contour.buffers.keys[to] = moving;
    }
    if (known < count) {
        const auto fresh = contour.buffers.keys.begin() + static_cast<std::ptrdiff_t>(known);
        std::stable_sort(fresh, contour.buffers.keys.end(), before);
        std::inplace_merge(contour.buffers.keys.begin(), fresh, contour.buffers.keys.end(), before);
    }
    for (std::size_t at = 0; at < count; ++at) contour.order[at] = contour.buffers.keys[at].second;
    contour.num_ordered = count;
}

// The boxes of the patches by strips, so that the time of the filter stays linear in their number. Calls visit(i, j)
// for patches whose boxes meet, one of them active and neither next to the other, until it returns true for this i.
// True if any call returned true.
template <int D, typename Visit>
bool sweep(Contour<D>& contour, Visit visit) {
    sort_patches(contour);
    auto& moving = contour.buffers.moving;
    auto& strips = contour.buffers.strips;
    moving.assign(static_cast<std::size_t>(contour.size()), 0);
    for (const int i : contour.active) moving[static_cast<std::size_t>(i)] = contour[i].active;
    const std::size_t count =
        std::max<std::size_t>(1, std::min(contour.order.size() / kStripPatches,
                                          static_cast<std::size_t>(contour.field.height()) / kStripHeight));
    const double scale = static_cast<double>(count) / contour.field.height();
    strips.resize(std::max(count, strips.size()));
    for (std::size_t at = 0; at < count; ++at) strips[at].reset(contour.order.size());
    const auto strip_of = [&](double y) {
        return static_cast<std::size_t>(std::clamp(y * scale, 0.0, static_cast<double>(count - 1)));
    };
    for (const int i : contour.order) {
        const Box& box = contour.box(i);
        const bool moves = moving[static_cast<std::size_t>(i)] != 0;
        if (count == 1) {
            strips[0].push(box, i, moves);
            continue;
        }
        for (std::size_t at = strip_of(box.y0), last = strip_of(box.y1); at <= last; ++at)
            strips[at].push(box, i, moves);
    }
    bool any = false;
    for (std::size_t at = 0; at < count; ++at) {
        any |=
            strips[at].each_meeting([&](int i) { return std::array<int, 2>{contour[i].prev, contour[i].next}; },
                                    [&](int i, int j) { return contour.box(i).meets(contour.box(j)) && visit(i, j); });
    }
    return any;
}

// The same for few active patches: each is compared with all others.
template <int D, typename Visit>
bool compare_with_all(Contour<D>& contour, Visit visit) {
    bool any = false;
    const int count = contour.size();
    const std::size_t moving = contour.active.size();
    for (std::size_t at = 0; at < moving; ++at) {
        const int i = contour.active[at], prev = contour[i].prev, next = contour[i].next;
        const Box box = contour.box(i);
        for (int j = 0; j < count; ++j) {
            if (!box.meets(contour.box(j)) || j == i || j == prev || j == next) continue;
            if (!visit(i, j)) continue;
            any = true;
            break;
        }
    }
    return any;
}

}  // namespace ffseg::topology
