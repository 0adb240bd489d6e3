// Settled patches as curves: their total turning, and polygons that show where two of them cross.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "freeform/settling/settle.hpp"

namespace ffseg::settling {

// Radians: a curve that turns by less, up to rounding, does not cross itself.
constexpr double kHalfTurn = 3.14159;
// Chords between two samples in a fine test.
constexpr std::size_t kFine = 32;
using Fine = std::array<Vec2, kFine + 1>;

// The patch that begins at a sample of a component.
struct Place {
    std::size_t component, first;
    bool operator<(const Place& o) const {
        return component != o.component ? component < o.component : first < o.first;
    }
    bool operator==(const Place& o) const { return component == o.component && first == o.first; }
};

template <int D>
struct Piece {
    Place place;
    int prev, next;  // in its component
    std::array<Vec2, D + 1> control;
    Box box;
    bool onward;  // the control polygon advances along its chord
    bool moved;   // since crossings were last looked for

    bool same_as(const Piece& o) const {
        return place == o.place && prev == o.prev && next == o.next &&
               std::equal(control.begin(), control.end(), o.control.begin(),
                          [](Vec2 a, Vec2 b) { return a.x == b.x && a.y == b.y; });
    }

    Vec2 entering() const { return control[1] - control[0]; }
    Vec2 leaving() const { return control[D] - control[D - 1]; }
};

// The angle between two sides; pi if one has no length.
inline double turn(Vec2 u, Vec2 v) {
    const double across = ffseg::cross(u, v), along = dot(u, v);
    return across == 0 && along == 0 ? kHalfTurn : std::abs(std::atan2(across, along));
}

// The total turning of the control polygon. A curve whose polygon turns by less than pi does not cross itself, nor do
// two with a common joint that together turn by less.
template <int D>
double turning(const Piece<D>& a) {
    double sum = 0.0;
    for (std::size_t k = 1; k < D; ++k) sum += turn(a.control[k] - a.control[k - 1], a.control[k + 1] - a.control[k]);
    return sum;
}

// Do two patches with a common joint advance in a common direction? Then they cannot cross.
template <int D>
bool run_one_way(const Piece<D>& a, const Piece<D>& b) {
    const Vec2 along = b.control[D] - a.control[0];
    for (std::size_t k = 0; k < D; ++k) {
        if (!(dot(a.control[k + 1] - a.control[k], along) > 0 && dot(b.control[k + 1] - b.control[k], along) > 0)) {
            return false;
        }
    }
    return true;
}

// Largest distance between a curve and its outline: the sagitta of a chord.
template <std::size_t N>
double sagitta(const std::array<Vec2, N>& line) {
    double bend = 0.0;
    for (std::size_t i = 1; i + 1 < N; ++i) {
        bend = std::max(bend, norm2(line[i + 1] - line[i] - (line[i] - line[i - 1])));
    }
    return 0.125 * std::sqrt(bend);
}

// Squared distance from a point to a segment.
inline double distance2(Vec2 p, Vec2 a, Vec2 b) {
    const Vec2 along = b - a;
    const double size = norm2(along), t = size > 0 ? std::clamp(dot(p - a, along) / size, 0.0, 1.0) : 0.0;
    return norm2(p - (a + t * along));
}

inline Box box_of(const Vec2* points, std::size_t count) {
    Box box;
    for (std::size_t i = 0; i < count; ++i) box.add(points[i]);
    return box;
}

inline Box widened(const Box& box, double by) { return {box.x0 - by, box.y0 - by, box.x1 + by, box.y1 + by}; }

// The chords of a polygon that intersect a box, mostly few.
template <std::size_t N>
struct Near {
    std::array<Box, N> boxes;
    std::array<std::size_t, N> chords;
    std::size_t count = 0;
    Box around;

    Near(const std::array<Vec2, N>& line, const Box& within) {
        for (std::size_t j = 0; j + 1 < N; ++j) {
            const Box box = box_of(&line[j], 2);
            if (!box.meets(within)) continue;
            boxes[count] = box;
            chords[count++] = j;
            around = joined(around, box);
        }
    }
};

// Does any chord of one polygon, and one of another whose boxes meet once widened by `near`, pass a test of their
// numbers?
template <std::size_t N, class Test>
bool any_meeting(const std::array<Vec2, N>& p, const std::array<Vec2, N>& q, double near, const Test& passes) {
    const Near<N> reached(q, widened(box_of(p.data(), N), near));
    for (std::size_t i = 0; reached.count > 0 && i + 1 < N; ++i) {
        const Box box = widened(box_of(&p[i], 2), near);
        if (!box.meets(reached.around)) continue;
        for (std::size_t k = 0; k < reached.count; ++k) {
            if (box.meets(reached.boxes[k]) && passes(i, reached.chords[k])) return true;
        }
    }
    return false;
}

// Do two polygons cross, or come nearer than `near` to each other beside the end of the first?
template <std::size_t N>
bool touch(const std::array<Vec2, N>& p, const std::array<Vec2, N>& q, double near) {
    return any_meeting(p, q, near, [&](std::size_t i, std::size_t j) {
        if (segments_cross(p[i], p[i + 1], q[j], q[j + 1])) return true;
        const bool off_joint = norm2(p[i] - p.back()) > 25 * near * near;
        return near > 0 && off_joint && distance2(p[i], q[j], q[j + 1]) < near * near;
    });
}

// The curve of a patch from its sample k to the next.
template <int D>
Fine finely(const Piece<D>& a, std::size_t k) {
    Fine curve;
    for (std::size_t j = 0; j <= kFine; ++j) {
        std::array<Vec2, D + 1> left = a.control;  // de Casteljau (Algorithm 1)
        const double t = (static_cast<double>(k) + static_cast<double>(j) / kFine) / D;
        for (std::size_t level = 1; level <= D; ++level) {
            for (std::size_t i = 0; i + level <= D; ++i) left[i] += t * (left[i + 1] - left[i]);
        }
        curve[j] = left[0];
    }
    return curve;
}

template <int D>
bool cross_finely(const Piece<D>& a, const Piece<D>& b) {
    std::array<Fine, D> others;
    std::array<Box, D> boxes;
    for (std::size_t j = 0; j < D; ++j) {
        others[j] = finely(b, j);
        for (const Vec2 p : others[j]) boxes[j].add(p);
    }
    for (std::size_t i = 0; i < D; ++i) {
        const Fine curve = finely(a, i);
        Box box;
        for (const Vec2 p : curve) box.add(p);
        for (std::size_t j = 0; j < D; ++j) {
            if (box.meets(boxes[j]) && touch(curve, others[j], 0.0)) return true;
        }
    }
    return false;
}

}  // namespace ffseg::settling
