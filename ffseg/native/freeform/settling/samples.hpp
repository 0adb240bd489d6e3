// Re-sampling of a component: evenly, without duplicates, and on curves that do not oscillate.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "common/along.hpp"
#include "freeform/basis.hpp"
#include "freeform/field/field.hpp"

namespace ffseg::settling {

using field::Field;
using freeform::apply;
using freeform::Basis;
using freeform::kBasis;
using freeform::kOscillation;

// Pixels: samples nearer to each other add no information.
constexpr double kMinSampleDistance = 0.5;

// One component as its samples in order, D to a patch.
using Samples = std::vector<Vec2>;

// The D + 1 samples of the patch that begins at a sample.
template <int D>
std::array<Vec2, D + 1> patch_of(const Samples& component, std::size_t first) {
    std::array<Vec2, D + 1> points;
    for (std::size_t k = 0; k < D; ++k) points[k] = component[first + k];
    points[D] = component[first + D < component.size() ? first + D : 0];
    return points;
}

// Drops samples that are too close together or turn back.
inline void tidy(Samples& at) {
    Samples kept;
    for (const Vec2 p : at) {
        if (!kept.empty() && norm2(p - kept.back()) < kMinSampleDistance * kMinSampleDistance) continue;
        if (kept.size() >= 2) {
            const Vec2 a = kept.back() - kept[kept.size() - 2], b = p - kept.back();
            if (dot(a, b) < -0.5 * norm(a) * norm(b) && norm2(a) < 4.0 && norm2(b) < 4.0) kept.pop_back();
        }
        kept.push_back(p);
    }
    if (kept.size() >= 4) at = std::move(kept);
}

// The samples, with points of the curve between them where it leaves their polygon by more than this.
template <int D>
Samples with_bends(const Samples& at, double most) {
    constexpr int kSub = Basis<D>::kSub;
    Samples out;
    out.reserve(at.size());
    for (std::size_t first = 0; first < at.size(); first += D) {
        const auto points = patch_of<D>(at, first);
        for (int k = 0; k < D; ++k) {
            out.push_back(points[k]);
            const Vec2 middle = apply<D>(kBasis<D>.between[k][kSub / 2], points);
            if (norm2(middle - 0.5 * (points[k] + points[k + 1])) <= most * most) continue;
            for (int j = 1; j < kSub; ++j) out.push_back(apply<D>(kBasis<D>.between[k][j], points));
        }
    }
    return out;
}

// New samples, evenly along the polygon of the old ones, at most `spacing` apart.
template <int D>
void lay_out(Samples& at, double spacing) {
    tidy(at);
    Along along(at.data(), at.size(), true);
    const auto patches = static_cast<std::size_t>(std::ceil(along.length() / (D * spacing)));
    const std::size_t count = std::max<std::size_t>(std::max<std::size_t>(2, patches) * D, D == 1 ? 3 : 4);
    Samples even(count);
    for (std::size_t i = 0; i < count; ++i) {
        even[i] = along.at(along.length() * static_cast<double>(i) / static_cast<double>(count));
    }
    while (even.size() % D != 0 || even.size() < 2 * D) even.push_back(at[0]);
    at = std::move(even);
}

// Replaced by the least-squares curve of lower degree: patches whose control polygon crosses itself, as they may loop,
// or is much longer than the polygon of samples, as they oscillate, or leaves or reaches an end backwards (a hook).
template <int D>
void reduce_degree(Samples& at, const Field& field) {
    for (std::size_t first = 0; first < at.size(); first += D) {
        const auto points = patch_of<D>(at, first);
        auto control = points;
        for (std::size_t k = 1; k < D; ++k) control[k] = apply<D>(kBasis<D>.inverse[k], points);
        double size = 0.0, polygon = 0.0;
        bool loops = false;
        for (std::size_t k = 1; k <= D; ++k) {
            polygon += norm(control[k] - control[k - 1]);
            size += norm(points[k] - points[k - 1]);
            for (std::size_t j = 1; j + 1 < k; ++j) {
                loops = loops || segments_cross(control[j - 1], control[j], control[k - 1], control[k]);
            }
        }
        const bool hooks = dot(control[1] - control[0], points[1] - points[0]) < 0 ||
                           dot(control[D] - control[D - 1], points[D] - points[D - 1]) < 0;
        if (!loops && !hooks && polygon <= kOscillation * size) continue;
        for (std::size_t k = 1; k < D; ++k) at[first + k] = field.clamp(apply<D>(kBasis<D>.reduced[k], points));
    }
}

}  // namespace ffseg::settling
