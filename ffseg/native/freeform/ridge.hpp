// The attraction to edges: stopped samples settle on the ridge of the gradient, along their normals.
#pragma once
#include <limits>

#include "freeform/chain.hpp"

namespace ffseg {

// The search looks at the gradient every half pixel and refines the peak by a parabola.
constexpr double kRidgeStep = 0.5;
// It also looks this far back: the band was entered by rounding, never by more than a pixel.
constexpr double kRidgeBack = 1.0;
// A stopped sample stands before the band of a Canny edge: one pixel of band and half an edge pixel.
constexpr double kRidgeAhead = 1.5;
// A peak lower than this part of the highest in reach is noise on its flank.
constexpr double kRidgeShare = 0.5;
// A displacement this far from the median of its neighbours follows another edge and takes the median instead.
constexpr double kRidgeOutlier = 1.0;
// Where the ridge runs farther than this from the curve between samples, the patch is split.
constexpr double kRidgeMiss = 0.3;
constexpr int kRidgeRounds = 3;

class Ridge {
public:
    Ridge(const GradientView& gradient, double low) : view_(gradient), low_(low) {}

    double value(Vec2 p) const {
        const double x = std::min(std::max(p.x, 0.0), view_.width - 1.0);
        const double y = std::min(std::max(p.y, 0.0), view_.height - 1.0);
        const int column = std::min(static_cast<int>(x), std::max(view_.width - 2, 0));
        const int row = std::min(static_cast<int>(y), std::max(view_.height - 2, 0));
        const int right = view_.width > 1 ? 1 : 0, down = view_.height > 1 ? view_.width : 0;
        const std::uint16_t* at = view_.data + static_cast<std::ptrdiff_t>(row) * view_.width + column;
        const double u = x - column, v = y - row;
        return (1 - v) * ((1 - u) * at[0] + u * at[right]) + v * ((1 - u) * at[down] + u * at[down + right]);
    }

    // Signed distance from p along `normal` to the peak nearest to `expected` in [from, to]; NaN without a peak.
    double offset(Vec2 p, Vec2 normal, double from, double to, double expected) const {
        constexpr int kMost = 64;
        std::array<double, kMost> profile;
        const int count = std::min(kMost, static_cast<int>((to - from) / kRidgeStep) + 3);
        const double start = from - kRidgeStep;
        double highest = 0.0;
        for (int j = 0; j < count; ++j) {
            profile[static_cast<std::size_t>(j)] = value(p + (start + j * kRidgeStep) * normal);
            if (j > 0 && j + 1 < count) highest = std::max(highest, profile[static_cast<std::size_t>(j)]);
        }
        const double floor = std::max(low_, kRidgeShare * highest);
        double best = std::numeric_limits<double>::quiet_NaN();
        for (int j = 1; j + 1 < count; ++j) {
            const double a = profile[static_cast<std::size_t>(j - 1)], b = profile[static_cast<std::size_t>(j)],
                         c = profile[static_cast<std::size_t>(j + 1)];
            if (b < floor || b < a || b <= c) continue;
            const double peak = start + kRidgeStep * (j + 0.5 * (a - c) / (a - 2 * b + c));
            if (!(std::abs(peak - expected) >= std::abs(best - expected))) best = peak;
        }
        return best;
    }

private:
    GradientView view_;
    double low_;
};

// One component while it settles: its samples in order with their displacements.
template <int D>
class Settling {
public:
    Settling(Pool<D>& pool, const Field& field, const Ridge& ridge) : pool_(pool), field_(field), ridge_(ridge) {}

    void run(int loop, double reach, bool refine, int& splits) {
        pass(loop, -kRidgeBack, reach, kRidgeAhead);
        pass(loop, -kRidgeAhead, kRidgeAhead, 0.0);
        for (int round = 0; refine && round < kRidgeRounds; ++round) {
            const int fresh = split_missed(loop, reach);
            splits += fresh;
            if (fresh == 0) break;
            pass(loop, -0.5 * reach, 0.5 * reach, 0.0);
        }
    }

private:
    struct Sample {
        int patch, k;
        Vec2 at, normal;
        double offset;
    };

    void collect(int loop) {
        const Basis<D>& basis = Basis<D>::get();
        samples_.clear();
        Vec2 last = unit(apply<D>(basis.slope[D], pool_.samples(pool_[loop].prev)));
        int i = loop;
        do {
            const auto points = pool_.samples(i);
            for (int k = 0; k < D; ++k) {
                Vec2 tangent = unit(apply<D>(basis.slope[k], points));
                if (k == 0) tangent = unit(tangent + last);
                samples_.push_back({i, k, points[k], {tangent.y, -tangent.x}, 0.0});
            }
            last = unit(apply<D>(basis.slope[D], points));
            i = pool_[i].next;
        } while (i != loop);
    }

    void pass(int loop, double from, double to, double expected) {
        collect(loop);
        for (Sample& s : samples_) s.offset = ridge_.offset(s.at, s.normal, from, to, expected);
        agree();
        for (Sample& s : samples_) {
            if (std::isnan(s.offset)) s.offset = to_limit(s);
        }
        unfold();
        for (const Sample& s : samples_) pool_[s.patch].m[s.k] = field_.clamp(s.at + s.offset * s.normal);
    }

    // Gaps take the mean of what their neighbours found; lone departures take the median.
    void agree() {
        const std::size_t n = samples_.size();
        std::vector<double> found(n);
        for (std::size_t i = 0; i < n; ++i) found[i] = samples_[i].offset;
        for (std::size_t i = 0; i < n; ++i) {
            std::array<double, 5> near;
            int count = 0;
            for (std::size_t shift = 0; shift < 5; ++shift) {
                const double value = found[(i + n - 2 + shift) % n];
                if (!std::isnan(value)) near[static_cast<std::size_t>(count++)] = value;
            }
            if (count < 3) continue;
            std::sort(near.begin(), near.begin() + count);
            const double median = 0.5 * (near[static_cast<std::size_t>((count - 1) / 2)] + near[static_cast<std::size_t>(count / 2)]);
            double& offset = samples_[i].offset;
            if (std::isnan(offset) || std::abs(offset - median) > kRidgeOutlier) offset = median;
        }
    }

    // A sample with no ridge in reach: if the domain stopped it, it moves up to the domain's limit.
    double to_limit(const Sample& s) const {
        constexpr double kFine = 1.0 / 16.0, kFar = 1.5;
        for (double ahead = kFine; ahead <= kFar; ahead += kFine) {
            const Vec2 p = s.at + ahead * s.normal;
            if (field_.outside_domain(p)) return ahead - kFine;
        }
        return 0.0;
    }

    // Where the displacements would turn a stretch round, both ends stay nearer to where they were.
    void unfold() {
        const std::size_t n = samples_.size();
        for (int round = 0; round < 4; ++round) {
            bool any = false;
            for (std::size_t i = 0; i < n; ++i) {
                Sample &a = samples_[i], &b = samples_[(i + 1) % n];
                const Vec2 before = b.at - a.at;
                const Vec2 after = before + b.offset * b.normal - a.offset * a.normal;
                if (dot(before, after) > 0.1 * norm2(before)) continue;
                a.offset *= 0.5;
                b.offset *= 0.5;
                any = true;
            }
            if (!any) break;
        }
    }

    int split_missed(int loop, double reach) {
        constexpr int kHalf = Basis<D>::kSub / 2;
        const Basis<D>& basis = Basis<D>::get();
        int splits = 0, i = loop;
        do {
            const int next = pool_[i].next;
            const auto points = pool_.samples(i);
            bool missed = false;
            double size = 0.0;
            for (int k = 0; k < D; ++k) size += norm(points[k + 1] - points[k]);
            for (int k = 0; k < D && !missed && size > 2 * D * kMinSpacing; ++k) {
                if (norm(points[k + 1] - points[k]) < 2 * kMinSpacing) continue;
                const Vec2 tangent = unit(apply<D>(basis.between_slope[k][kHalf], points));
                const double off = ridge_.offset(apply<D>(basis.between[k][kHalf], points), {tangent.y, -tangent.x},
                                                 -0.5 * reach, 0.5 * reach, 0.0);
                missed = std::abs(off) > kRidgeMiss;
            }
            if (missed) {
                pool_.split(i);
                ++splits;
            }
            i = next;
        } while (i != loop);
        return splits;
    }

    static Vec2 unit(Vec2 v) {
        const double size = norm(v);
        return size > 0 ? (1.0 / size) * v : Vec2{};
    }

    Pool<D>& pool_;
    const Field& field_;
    const Ridge& ridge_;
    std::vector<Sample> samples_;
};

template <int D>
void Chain<D>::settle(const GradientView& gradient) {
    if (options_.settle <= 0) return;
    const Ridge ridge(gradient, options_.ridge_low);
    Settling<D> settling(pool_, field_, ridge);
    for (int loop : loops()) settling.run(loop, options_.settle, options_.refine, counts_.splits);
}

}  // namespace ffseg
