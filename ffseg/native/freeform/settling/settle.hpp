// Attraction to edges: a stopped contour settles on the ridge of the gradient, along its normals.
#pragma once
#include <algorithm>
#include <numeric>
#include <vector>

#include "freeform/settling/ridge.hpp"
#include "freeform/settling/samples.hpp"

namespace ffseg::settling {

// Pixels searched backwards: a sample enters the band by rounding only, never by more than a pixel.
constexpr double kRidgeBack = 1.0;
// Pixels searched ahead: a stopped sample stands before the band of a Canny edge, one pixel of band and half an edge
// pixel.
constexpr double kRidgeAhead = 1.5;
// Pixels: a displacement that differs this much from the median of its neighbours' follows another edge, and the
// median is used instead.
constexpr double kRidgeOutlier = 1.0;
// Pixels: where the ridge lies farther than this from the curve between samples, the patch is split, in at most this
// many rounds.
constexpr double kRidgeMiss = 0.3;
constexpr int kRidgeRounds = 3;
// Pixels: only patches whose samples bend by at least this second difference are tested, as smoothing leaves no edge
// that departs from a straight line and returns between two samples.
constexpr double kBent = 0.8;
// Where the curve leaves the polygon of its samples by more than this fraction of the search range, new samples follow
// the curve: from the polygon the ridge would be out of range.
constexpr double kMaxBend = 0.5;
// Pixels between samples of a settled contour: two scales of the smoothing, below which edges have no detail.
constexpr double kSettledSpacing = 3.0;
// Pixels to either side over which normals are taken, more than the jitter of samples stopped by a pixel staircase.
constexpr double kNormalReach = 2.0;
// Pixels: step of the search for the limit of the domain.
constexpr double kToLimit = 1.0 / 16.0;
template <int D>
class Settling {
public:
    Settling(const Field& field, const Ridge& ridge, double reach) : field_(field), ridge_(ridge), reach_(reach) {}

    // Returns the settled samples; with `refine` they are re-sampled, evenly, and more densely where the ridge bends.
    Samples run(Samples samples, bool refine, double spacing, int& splits) {
        at_ = std::move(samples);
        if (refine) {
            at_ = with_bends<D>(at_, kMaxBend * reach_);
            lay_out<D>(at_, std::min(spacing, kSettledSpacing));
        }
        take_all();
        project(kRidgeAhead, -kRidgeBack, reach_);
        for (int round = 0; refine && round < kRidgeRounds; ++round) {
            const int split = split_missed();
            splits += split;
            if (split == 0) break;
            project(0.0, -0.5 * reach_, 0.5 * reach_);
        }
        take_all();
        project(0.0, -1.0, 1.0);
        if (D > 2) reduce_degree<D>(at_, field_);
        return std::move(at_);
    }

private:
    std::size_t before(std::size_t i) const { return (i > 0 ? i : at_.size()) - 1; }
    std::size_t after(std::size_t i) const { return i + 1 < at_.size() ? i + 1 : 0; }

    void take_all() {
        fresh_.resize(at_.size());
        std::iota(fresh_.begin(), fresh_.end(), std::size_t{0});
    }

    // Moves fresh samples to the ridge uphill from `expected` within [from, to], or else like their neighbours.
    void project(double expected, double from, double to) {
        offset_.assign(at_.size(), 0.0);
        normal_.resize(at_.size());
        measure();
        for (const std::size_t i : fresh_) {
            normal_[i] = normal_across(i);
            ridge_.announce(at_[i] + expected * normal_[i]);
        }
        for (const std::size_t i : fresh_) {
            offset_[i] = ridge_.climb(at_[i], normal_[i], expected, from, to);
        }
        reject_outliers();
        for (const std::size_t i : fresh_) {
            if (std::isnan(offset_[i])) offset_[i] = to_limit(i);
        }
        unfold();
        for (const std::size_t i : fresh_) at_[i] = in_domain(i);
    }

    // The chords at fresh samples: their directions, and which are long enough for a normal.
    void measure() {
        chords_.clear();
        for (const std::size_t i : fresh_) {
            if (chords_.empty() || chords_.back() != before(i)) chords_.push_back(before(i));
            chords_.push_back(i);
        }
        if (chords_.size() > 1 && chords_.front() == chords_.back()) chords_.erase(chords_.begin());
        along_.resize(at_.size());
        far_.resize(at_.size());
        for (const std::size_t i : chords_) {
            const Vec2 chord = at_[after(i)] - at_[i];
            far_[i] = norm2(chord) >= kNormalReach * kNormalReach;
            along_[i] = unit(chord);
        }
    }

    Vec2 normal_across(std::size_t i) const {
        std::size_t back = before(i), ahead = after(i);
        Vec2 tangent;
        if ((far_[back] & far_[i]) != 0) {
            tangent = unit(along_[back] + along_[i]);
        } else {
            constexpr double kFar = kNormalReach * kNormalReach;
            for (int tries = 0; tries < 4 && norm2(at_[i] - at_[back]) < kFar; ++tries) back = before(back);
            for (int tries = 0; tries < 4 && norm2(at_[ahead] - at_[i]) < kFar; ++tries) ahead = after(ahead);
            tangent = unit(unit(at_[i] - at_[back]) + unit(at_[ahead] - at_[i]));
        }
        return {tangent.y, -tangent.x};
    }

    // Samples without a ridge take the median of their neighbours' displacements; so do outliers.
    void reject_outliers() {
        const std::size_t n = at_.size();
        found_ = offset_;
        for (const std::size_t i : fresh_) {
            const double here = found_[i], step = 0.5 * kRidgeOutlier;
            if (std::abs(here - found_[before(i)]) < step && std::abs(here - found_[after(i)]) < step) continue;
            std::array<double, 5> near{};
            std::size_t count = 0;
            for (std::size_t shift = 0; shift < 5; ++shift) {
                const double value = found_[(i + 2 * n - 2 + shift) % n];
                if (!std::isnan(value)) near[count++] = value;
            }
            if (count < 3) continue;
            std::sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(count));
            const double median = 0.5 * (near[(count - 1) / 2] + near[count / 2]);
            if (std::isnan(here) || std::abs(here - median) > kRidgeOutlier) offset_[i] = median;
        }
    }

    // The target of a sample, limited to the image and the domain.
    Vec2 in_domain(std::size_t i) const {
        for (double back = 0.0; back <= reach_ + kRidgeAhead; back += kToLimit) {
            const Vec2 moved = field_.clamp(at_[i] + (offset_[i] - back) * normal_[i]);
            if (!field_.outside_domain(moved)) return moved;
        }
        return field_.clamp(at_[i] + offset_[i] * normal_[i]);
    }

    // A sample without a ridge in range that the domain stopped moves up to the domain's limit.
    double to_limit(std::size_t i) const {
        constexpr double kFar = 1.5;
        for (double ahead = kToLimit; ahead <= kFar; ahead += kToLimit) {
            if (field_.outside_domain(at_[i] + ahead * normal_[i])) return ahead - kToLimit;
        }
        return 0.0;
    }

    // Displacements that would reverse an interval are reduced at both ends.
    void unfold() {
        for (int round = 0; round < 4; ++round) {
            bool any = false;
            for (const std::size_t i : chords_) {
                const std::size_t j = after(i);
                const Vec2 chord = at_[j] - at_[i];
                const Vec2 moved = chord + offset_[j] * normal_[j] - offset_[i] * normal_[i];
                if (dot(chord, moved) > 0.1 * norm2(chord) || (offset_[i] == 0 && offset_[j] == 0)) continue;
                offset_[i] *= 0.5;
                offset_[j] *= 0.5;
                any = true;
            }
            if (!any) break;
        }
    }

    // Splits (Algorithm 2) fresh patches whose curve leaves the ridge between samples; their halves are fresh again.
    int split_missed() {
        std::vector<std::size_t> missed;
        for (std::size_t at = 0; at < fresh_.size(); at += D) {
            if (misses(patch_of<D>(at_, fresh_[at]))) missed.push_back(fresh_[at]);
        }
        fresh_.clear();
        if (missed.empty()) return 0;
        Samples finer;
        finer.reserve(at_.size() + missed.size() * D);
        auto kept = at_.cbegin();
        for (const std::size_t first : missed) {
            const auto here = at_.cbegin() + static_cast<std::ptrdiff_t>(first);
            finer.insert(finer.end(), kept, here);
            kept = here + D;
            const auto points = patch_of<D>(at_, first);
            for (std::size_t k = 0; k < 2 * D; ++k) {
                fresh_.push_back(finer.size());
                finer.push_back(apply<D>(kBasis<D>.halves[k], points));
            }
        }
        finer.insert(finer.end(), kept, at_.cend());
        at_ = std::move(finer);
        return static_cast<int>(missed.size());
    }

    bool misses(const std::array<Vec2, D + 1>& points) const {
        constexpr int kHalf = Basis<D>::kSub / 2;
        double bend = D > 1 ? 0.0 : kBent;
        for (std::size_t k = 1; k < D; ++k) {
            bend = std::max(bend, norm2(points[k + 1] - points[k] - (points[k] - points[k - 1])));
        }
        if (bend < kBent * kBent) return false;
        for (std::size_t k = 0; k < D; ++k) {
            if (norm2(points[k + 1] - points[k]) < 4 * kMinSampleDistance * kMinSampleDistance) continue;
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
    std::vector<double> offset_, found_;
    std::vector<std::size_t> fresh_;   // samples not yet moved to the ridge, of whole patches
    std::vector<std::size_t> chords_;  // first samples of the chords that move
};

}  // namespace ffseg::settling
