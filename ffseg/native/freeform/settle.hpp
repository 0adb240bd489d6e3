// The attraction to edges: a stopped contour settles on the ridge of the gradient, along its normals.
#pragma once
#include <algorithm>
#include <vector>

#include "freeform/along.hpp"
#include "freeform/basis.hpp"
#include "freeform/field.hpp"
#include "freeform/ridge.hpp"

namespace ffseg {

// The search also looks this far back: the band was entered by rounding, never by more than a pixel.
constexpr double kRidgeBack = 1.0;
// A stopped sample stands before the band of a Canny edge: one pixel of band and half an edge pixel.
constexpr double kRidgeAhead = 1.5;
// A displacement this far from the median of its neighbours follows another edge and takes the median instead.
constexpr double kRidgeOutlier = 1.0;
// Where the ridge runs farther than this from the curve between samples, the patch is split.
constexpr double kRidgeMiss = 0.3;
constexpr int kRidgeRounds = 3;
// Only patches whose samples bend at least so far (second difference, px) are looked at: smoothing leaves no edge that
// departs from a straight line and returns between two samples.
constexpr double kBent = 0.8;
// Distance between the samples of a settled contour: two scales of the smoothing, below which edges have no detail.
constexpr double kSettledSpacing = 3.0;
// Normals are taken across this distance to either side, over the jitter of samples stopped by a pixel staircase.
constexpr double kNormalReach = 2.0;
// Samples nearer to each other say nothing new.
constexpr double kClosest = 0.5;

// A control polygon this many times longer than the polygon of samples belongs to a curve that swings; that of a
// quarter circle is 1.1 times longer.
constexpr double kSwing = 1.25;

// One component as its samples in order, D to a patch.
using Samples = std::vector<Vec2>;

// Both ends and what lies between them of the patch that begins at a sample.
template <int D>
std::array<Vec2, D + 1> patch_of(const Samples& component, std::size_t first) {
    std::array<Vec2, D + 1> points;
    for (std::size_t k = 0; k <= D; ++k) points[k] = component[(first + k) % component.size()];
    return points;
}

template <int D>
class Settling {
public:
    Settling(const Field& field, const Ridge& ridge, double reach) : field_(field), ridge_(ridge), reach_(reach) {}

    // Returns the settled samples; with `refine` they are laid out anew, evenly, and closer where the ridge bends.
    Samples run(Samples samples, bool refine, double spacing, int& splits) {
        at_ = std::move(samples);
        fresh_.assign(at_.size(), 1);
        if (refine) lay_out(std::min(spacing, kSettledSpacing));
        fresh_.assign(at_.size(), 1);
        project(kRidgeAhead, -kRidgeBack, reach_);
        for (int round = 0; refine && round < kRidgeRounds; ++round) {
            const int split = split_missed();
            splits += split;
            if (split == 0) break;
            project(0.0, -0.5 * reach_, 0.5 * reach_);
        }
        fresh_.assign(at_.size(), 1);
        project(0.0, -1.0, 1.0);
        if (D > 2) calm();
        return std::move(at_);
    }

private:
    // Moves the fresh samples to the ridge found uphill from `expected`, else to the nearest in [from, to].
    void project(double expected, double from, double to) {
        const std::size_t n = at_.size();
        normal_.resize(n);
        offset_.assign(n, 0.0);
        measure();
        for (std::size_t i = 0; i < n; ++i) {
            if (!fresh_[i]) continue;
            normal_[i] = normal_across(i);
            offset_[i] = ridge_.climb(at_[i], normal_[i], expected, from, to);
            if (std::isnan(offset_[i])) offset_[i] = ridge_.offset(at_[i], normal_[i], from, to, expected);
        }
        agree();
        for (std::size_t i = 0; i < n; ++i) {
            if (std::isnan(offset_[i])) offset_[i] = to_limit(i);
        }
        unfold();
        for (std::size_t i = 0; i < n; ++i) {
            if (fresh_[i]) at_[i] = field_.clamp(at_[i] + offset_[i] * normal_[i]);
        }
    }

    // The directions of the chords from one sample to the next, and which are long enough to take a normal across.
    void measure() {
        const std::size_t n = at_.size();
        along_.resize(n);
        far_.resize(n);
        for (std::size_t i = 0; i < n; ++i) along_[i] = at_[i + 1 < n ? i + 1 : 0] - at_[i];
        for (std::size_t i = 0; i < n; ++i) {
            far_[i] = norm2(along_[i]) >= kNormalReach * kNormalReach;
            along_[i] = unit(along_[i]);
        }
    }

    Vec2 normal_across(std::size_t i) const {
        const std::size_t n = at_.size();
        std::size_t back = i > 0 ? i - 1 : n - 1, ahead = i + 1 < n ? i + 1 : 0;
        Vec2 tangent;
        if ((far_[back] & far_[i]) != 0) {
            tangent = unit(along_[back] + along_[i]);
        } else {
            constexpr double kFar = kNormalReach * kNormalReach;
            for (int tries = 0; tries < 4 && norm2(at_[i] - at_[back]) < kFar; ++tries) back = (back + n - 1) % n;
            for (int tries = 0; tries < 4 && norm2(at_[ahead] - at_[i]) < kFar; ++tries) ahead = (ahead + 1) % n;
            tangent = unit(unit(at_[i] - at_[back]) + unit(at_[ahead] - at_[i]));
        }
        return {tangent.y, -tangent.x};
    }

    // Gaps take the median of what their neighbours found; so do lone departures.
    void agree() {
        const std::size_t n = at_.size();
        const std::vector<double> found = offset_;
        for (std::size_t i = 0; i < n; ++i) {
            if (!fresh_[i]) continue;
            const double here = found[i], step = 0.5 * kRidgeOutlier;
            if (std::abs(here - found[(i + n - 1) % n]) < step && std::abs(here - found[(i + 1) % n]) < step) continue;
            std::array<double, 5> near{};
            std::size_t count = 0;
            for (std::size_t shift = 0; shift < 5; ++shift) {
                const double value = found[(i + 2 * n - 2 + shift) % n];
                if (!std::isnan(value)) near[count++] = value;
            }
            if (count < 3) continue;
            std::sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(count));
            const double median = 0.5 * (near[(count - 1) / 2] + near[count / 2]);
            if (std::isnan(offset_[i]) || std::abs(offset_[i] - median) > kRidgeOutlier) offset_[i] = median;
        }
    }

    // A sample with no ridge in reach: if the domain stopped it, it moves up to the domain's limit.
    double to_limit(std::size_t i) const {
        constexpr double kFine = 1.0 / 16.0, kFar = 1.5;
        for (double ahead = kFine; ahead <= kFar; ahead += kFine) {
            if (field_.outside_domain(at_[i] + ahead * normal_[i])) return ahead - kFine;
        }
        return 0.0;
    }

    // Where the displacements would turn a stretch round, both ends stay nearer to where they were.
    void unfold() {
        const std::size_t n = at_.size();
        for (int round = 0; round < 4; ++round) {
            bool any = false;
            for (std::size_t i = 0; i < n; ++i) {
                const std::size_t j = (i + 1) % n;
                const Vec2 before = at_[j] - at_[i];
                const Vec2 after = before + offset_[j] * normal_[j] - offset_[i] * normal_[i];
                if (dot(before, after) > 0.1 * norm2(before) || (offset_[i] == 0 && offset_[j] == 0)) continue;
                offset_[i] *= 0.5;
                offset_[j] *= 0.5;
                any = true;
            }
            if (!any) break;
        }
    }

    // New samples, evenly along the polygon of the old ones, at most `spacing` apart.
    void lay_out(double spacing) {
        tidy();
        Along along(at_.data(), at_.size(), true);
        const auto patches = static_cast<std::size_t>(std::ceil(along.length() / (D * spacing)));
        const std::size_t count = std::max<std::size_t>(std::max<std::size_t>(2, patches) * D, D == 1 ? 3 : 4);
        Samples even(count);
        for (std::size_t i = 0; i < count; ++i) {
            even[i] = along.at(along.length() * static_cast<double>(i) / static_cast<double>(count));
        }
        while (even.size() % D != 0 || even.size() < 2 * D) even.push_back(at_[0]);
        at_ = std::move(even);
    }

    // Drops samples that stand too close or turn back.
    void tidy() {
        Samples kept;
        for (const Vec2 p : at_) {
            if (!kept.empty() && norm2(p - kept.back()) < kClosest * kClosest) continue;
            if (kept.size() >= 2) {
                const Vec2 a = kept.back() - kept[kept.size() - 2], b = p - kept.back();
                if (dot(a, b) < -0.5 * norm(a) * norm(b) && norm2(a) < 4.0 && norm2(b) < 4.0) kept.pop_back();
            }
            kept.push_back(p);
        }
        if (kept.size() >= 4) at_ = std::move(kept);
    }

    // Splits (Algorithm 2) the fresh patches whose curve leaves the ridge between samples; what they become is fresh.
    int split_missed() {
        Samples finer;
        std::vector<std::uint8_t> fresh;
        int splits = 0;
        for (std::size_t first = 0; first < at_.size(); first += D) {
            const auto points = patch_of<D>(at_, first);
            const bool split = fresh_[first] != 0 && misses(points);
            splits += split;
            for (std::size_t k = 0; k < (split ? 2 * D : D); ++k) {
                finer.push_back(split ? apply<D>(kBasis<D>.halves[k], points) : points[k]);
                fresh.push_back(split);
            }
        }
        at_ = std::move(finer);
        fresh_ = std::move(fresh);
        return splits;
    }

    // Patches whose control polygon crosses itself may loop, those whose polygon is much longer than that of the samples
    // swing about them, those that leave or reach an end backwards have a hook there: all take the least-squares curve of
    // lower degree.
    void calm() {
        for (std::size_t first = 0; first < at_.size(); first += D) {
            const auto points = patch_of<D>(at_, first);
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
            if (!loops && !hooks && polygon <= kSwing * size) continue;
            for (std::size_t k = 1; k < D; ++k) at_[first + k] = field_.clamp(apply<D>(kBasis<D>.calm[k], points));
        }
    }

    bool misses(const std::array<Vec2, D + 1>& points) const {
        constexpr int kHalf = Basis<D>::kSub / 2;
        double bend = D > 1 ? 0.0 : kBent;
        for (std::size_t k = 1; k < D; ++k) {
            bend = std::max(bend, norm2(points[k + 1] - points[k] - (points[k] - points[k - 1])));
        }
        if (bend < kBent * kBent) return false;
        for (std::size_t k = 0; k < D; ++k) {
            if (norm2(points[k + 1] - points[k]) < 4 * kClosest * kClosest) continue;
            const Vec2 tangent = unit(apply<D>(kBasis<D>.between_slope[k][kHalf], points));
            const Vec2 middle = apply<D>(kBasis<D>.between[k][kHalf], points);
            const double off = ridge_.climb(middle, {tangent.y, -tangent.x}, 0.0, -0.5 * reach_, 0.5 * reach_);
            if (std::abs(off) > kRidgeMiss) return true;
        }
        return false;
    }

    const Field& field_;
    const Ridge& ridge_;
    double reach_;
    Samples at_, normal_, along_;
    std::vector<std::uint8_t> far_;
    std::vector<double> offset_;
    std::vector<std::uint8_t> fresh_;  // 1 for samples that have not been moved to the ridge yet
};

}  // namespace ffseg
