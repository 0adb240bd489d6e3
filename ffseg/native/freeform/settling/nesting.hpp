// Which components bound the region: polygons of samples in one another.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

#include "freeform/settling/samples.hpp"

namespace ffseg::settling {

inline double twice_area(const Samples& at) {
    double twice = 0.0;
    for (std::size_t i = 0; i < at.size(); ++i) {
        twice += ffseg::cross(at[i] - at[0], at[(i + 1) % at.size()] - at[0]);
    }
    return twice;
}

// Is p inside the polygon of samples (even-odd)?
inline bool holds(const Samples& polygon, Vec2 p) {
    bool inside = false;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
        inside ^= passes_right_of(p, polygon[i], polygon[i + 1 < polygon.size() ? i + 1 : 0]);
    }
    return inside;
}

// Whether each component bounds the region: the winding number of the larger ones that do is 0 outside an outer
// component and 1 outside a hole.
inline std::vector<bool> bounding(const std::vector<Samples>& components, bool outside_filled) {
    struct Loop {
        std::size_t index;
        double twice;
        Box box;
    };
    std::vector<Loop> loops;
    for (std::size_t i = 0; i < components.size(); ++i) {
        loops.push_back({i, twice_area(components[i]), {}});
        for (const Vec2 p : components[i]) loops.back().box.add(p);
    }
    std::stable_sort(loops.begin(), loops.end(),
                     [](const Loop& a, const Loop& b) { return std::abs(a.twice) > std::abs(b.twice); });
    std::vector<bool> found(components.size(), false);
    std::vector<Loop> kept;
    for (const Loop& loop : loops) {
        const Vec2 p = components[loop.index][0];
        int winding = outside_filled ? 1 : 0;
        for (const Loop& other : kept) {
            if (other.box.holds(p) && holds(components[other.index], p)) winding += other.twice > 0 ? 1 : -1;
        }
        if (winding != (loop.twice > 0 ? 0 : 1)) continue;
        found[loop.index] = true;
        kept.push_back(loop);
    }
    return found;
}

}  // namespace ffseg::settling
