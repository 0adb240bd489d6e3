// Deformation of the patches (Eq. 7): samples move along their normals (Section 3.2).
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "freeform/contour.hpp"

namespace ffseg::freeform {

// Pixels between samples of the edge map along a normal.
constexpr double kMarchStep = 0.5;
// Pixels: largest step near edges. The edge band is three pixels wide, so that neither a sample nor the curve between
// two samples can cross it unnoticed.
constexpr double kCautiousStep = 2.0;
// Two discs round neighbouring samples contain the curve between them if their radii sum to this multiple of the
// chord: equal ones reach 0.41 chords to the side at its middle.
constexpr double kBulge = 1.3;
// Pixels: an edge within this distance ahead stops the contour whatever the colours say (region.weight), as they are
// localised less sharply.
constexpr double kEdgeAhead = 2.0;
// Pixels: a sample that moved less is steady (half a march step).
constexpr double kSteady = 0.25;

// How far a point may move along `normal`, at most `wanted`, before it meets what is blocked; `known` pixels are free.
inline double reach(const field::Field& field, Vec2 from, Vec2 normal, double wanted, double known) {
    if (known <= 0 && wanted >= kCautiousStep) {  // near edges: all points are tested, without branches
        const auto march = [&](auto is_blocked) {
            int steps = 0, free = 1;
            for (int at = 1; at <= static_cast<int>(kCautiousStep / kMarchStep); ++at) {
                free &= static_cast<int>(!is_blocked(from + (at * kMarchStep) * normal));
                steps += free;
            }
            return steps * kMarchStep;
        };
        if (field.holds(from, kCautiousStep)) return march([&](Vec2 p) { return field.blocked_inside(p); });
        return march([&](Vec2 p) { return field.blocked(p); });
    }
    const double limit = std::min(wanted, std::max(kCautiousStep, known));
    double s = std::min(limit, known);
    while (s < limit) {
        const double ahead = std::min(s + kMarchStep, limit);
        if (field.blocked(from + ahead * normal)) break;
        s = ahead;
    }
    return s;
}

// The tangents of the Bezier curve at its samples and the distances between them, before anything moves.
template <int D>
void measure(Contour<D>& contour, int i, Motion<D>& motion) {
    motion.points = contour.samples(i);
    std::array<Vec2, D + 1> slope;
    std::array<double, 2 * D + 1> size;  // squared lengths of slopes and chords, whose roots are taken together
    for (int k = 0; k <= D; ++k) {
        slope[k] = apply<D>(kBasis<D>.slope[k], motion.points);
        size[k] = norm2(slope[k]);
    }
    for (int k = 0; k < D; ++k) size[D + 1 + k] = norm2(motion.points[k + 1] - motion.points[k]);
    for (double& one : size) one = std::sqrt(one);
    std::array<double, D + 1> scale;
    for (int k = 0; k <= D; ++k) scale[k] = 1.0 / size[k];
    for (int k = 0; k <= D; ++k) slope[k] = size[k] > 0 ? scale[k] * slope[k] : Vec2{};
    std::copy_n(slope.begin(), D, motion.tangent.begin());
    if (contour.pressure != nullptr) {
        for (int k = 0; k < D; ++k) {
            contour.pressure->prefetch(motion.points[k] + contour.options.balloon * Vec2{slope[k].y, -slope[k].x});
        }
    }
    contour[i].end_tangent = slope[D];
    std::copy_n(size.begin() + D + 1, D, motion.chord.begin());
    contour[i].last_chord = motion.chord[D - 1];
}

template <int D>
void displace(Contour<D>& contour, int i, const Motion<D>& motion) {
    Patch<D>& patch = contour[i];
    const Patch<D>& prev = contour[patch.prev];
    unsigned steady = 0;
    double free = contour.field.free_reach(motion.points[D]);
    bool near_edges = free <= 0;
    for (int k = D - 1; k >= 0; --k) {
        const double ahead = free;
        free = contour.field.free_reach(motion.points[k]);
        // Could the curve between this sample and the next come near anything blocked, wherever they move?
        near_edges |= free + ahead < kBulge * motion.chord[k] + 2 * contour.options.balloon;
        const Vec2 tangent = k > 0 ? motion.tangent[k] : unit(motion.tangent[0] + prev.end_tangent);
        const Vec2 normal{tangent.y, -tangent.x};
        double s = reach(contour.field, motion.points[k], normal, contour.options.balloon, free);
        if (contour.pressure != nullptr && s >= std::min(kEdgeAhead, contour.options.balloon)) {
            s = contour.pressure->reach(motion.points[k], normal, s);
        }
        Vec2 to = motion.points[k] + s * normal;
        // Away from edges samples slide along the tangent towards even spacing; the shape is kept to first order.
        const double back = k > 0 ? motion.chord[k - 1] : prev.last_chord;
        const double aside = std::min(std::max(0.25 * (motion.chord[k] - back), -1.0), 1.0);
        to += (free > s + 1.0 ? aside : 0.0) * tangent;
        steady |= static_cast<unsigned>(s < kSteady) << k;
        patch.before[k] = to;  // swapped with m when every sample has its target
    }
    patch.near_edges = near_edges;
    patch.steady = static_cast<std::uint8_t>(steady);
    patch.reverted = 0;
}

// All samples move at once (Eq. 7 with displacements along the normals, at a joint along the mean of both patches').
template <int D>
void deform(Contour<D>& contour) {
    contour.buffers.motion.resize(contour.active.size());
    for (std::size_t at = 0; at < contour.active.size(); ++at)
        measure(contour, contour.active[at], contour.buffers.motion[at]);
    for (std::size_t at = 0; at < contour.active.size(); ++at)
        displace(contour, contour.active[at], contour.buffers.motion[at]);
    const std::size_t count = contour.active.size();
    for (std::size_t at = 0; at < count; ++at) {
        const int i = contour.active[at], prev = contour[i].prev;
        std::swap(contour[i].m, contour[i].before);
        if (contour[prev].active || (contour[i].steady & 1u) != 0) continue;
        contour[prev].before = contour[prev].m;
        contour[prev].steady = kAllSteady<D>;
        contour[prev].reverted = 0;
        contour[prev].near_edges = true;
        contour.wake(prev);
    }
}

}  // namespace ffseg::freeform
