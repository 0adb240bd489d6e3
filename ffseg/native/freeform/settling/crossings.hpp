// Crossings of settled contours with themselves and each other.
#pragma once
#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "freeform/settling/curves.hpp"
#include "freeform/topology/strips.hpp"

namespace ffseg::settling {

// Bound on the work of finding crossings, in pair tests per patch, with kFewPieces patches added so that few patches
// have some; cost of a fine test of two patches or of one, per degree, and of two that share a joint. Where texture
// stops a front everywhere cubics need up to 100 per patch in all, in noise 300, curves of degree 5 500.
constexpr std::size_t kMaxTests = 1024, kFewPieces = 1024, kFineTests = 128, kOwnTests = 64, kJointTests = 32;
// Pixels: curves nearer to each other than this touch, as far as any drawing can show.
constexpr double kTouch = 0.01;
// Pixels: polygons this near to their curves have the same crossings.
constexpr double kFlat = 0.001;
// Curves stay within this many sagittas of their polygons: the second derivative of a cubic is linear, and at its ends
// at most a fifth above the largest at the inner corners.
constexpr double kBendMargin = 2.0;

template <int D>
class Crossings {
public:
    explicit Crossings(const std::vector<Samples>& components) : components_(components) {}

    // All crossings; after the first time, only patches that have moved since are tested anew.
    void find() {
        collect();
        places_.clear();
        loops_.clear();
        order_.resize(pieces_.size());
        for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = {pieces_[i].box.x0, static_cast<int>(i)};
        std::sort(order_.begin(), order_.end());
        strip_.reset(pieces_.size());
        for (const auto& [left, i] : order_) strip_.push(piece(i).box, i, true);
        strip_.each_meeting([this](int i) { return std::array<int, 2>{piece(i).prev, piece(i).next}; },
                            [this](int i, int j) {
                                if (!piece(i).moved && !piece(j).moved) return false;
                                ++tests_;
                                if (exhausted()) return true;
                                if (cross(piece(i), piece(j))) note(piece(i), piece(j));
                                return false;
                            });
        for (const Piece<D>& a : pieces_) {
            const Piece<D>& b = piece(a.next);
            if (!a.moved && !b.moved) continue;
            if (!a.onward && turning(a) >= kHalfTurn && crosses_itself(a)) note(a, a);
            const bool winding =
                !run_one_way(a, b) && turning(a) + turn(a.leaving(), b.entering()) + turning(b) >= kHalfTurn;
            if (winding && touch(outline(a), outline(b), 0.0)) note(a, b);
            if ((winding && come_back(a, b)) || cusp(a, b)) {
                places_.push_back(a.place);
                places_.push_back(b.place);
            }
        }
        std::sort(places_.begin(), places_.end());
        places_.erase(std::unique(places_.begin(), places_.end()), places_.end());
    }

    // The patches with a crossing, in order.
    const std::vector<Place>& places() const { return places_; }
    // Pairs of one component that cross each other.
    const std::vector<std::pair<Place, Place>>& loops() const { return loops_; }
    bool exhausted() const { return tests_ > kMaxTests * (pieces_.size() + kFewPieces); }
    void restart() {
        tests_ = 0;
        pieces_.clear();
    }

private:
    static constexpr int kPieces = D <= 3 ? 4 : 8;
    static constexpr int kPoints = D * kPieces + 1;
    using Outline = std::array<Vec2, kPoints>;

    void collect() {
        const bool tested = !exhausted();
        const std::vector<Piece<D>> before = std::exchange(pieces_, {});
        for (std::size_t c = 0; c < components_.size(); ++c) {
            const Samples& at = components_[c];
            const int begin = static_cast<int>(pieces_.size()), count = static_cast<int>(at.size() / D);
            for (int i = 0; i < count; ++i) {
                const std::size_t first = static_cast<std::size_t>(i) * D;
                Piece<D> piece{{c, first}, begin + (i + count - 1) % count, begin + (i + 1) % count, {}, {}, true,
                               true};
                const std::array<Vec2, D + 1> points = patch_of<D>(at, first);
                for (std::size_t k = 0; k <= D; ++k) {
                    piece.control[k] = k % D == 0 ? points[k] : apply<D>(kBasis<D>.inverse[k], points);
                    piece.box.add(piece.control[k]);
                }
                for (std::size_t k = 0; k < D; ++k) {
                    const Vec2 side = piece.control[k + 1] - piece.control[k];
                    piece.onward = piece.onward && dot(side, points[D] - points[0]) > 0;
                }
                pieces_.push_back(piece);
            }
        }
        if (!tested || before.size() != pieces_.size()) return;
        for (std::size_t i = 0; i < pieces_.size(); ++i) {
            const bool crossed = std::binary_search(places_.begin(), places_.end(), pieces_[i].place);
            pieces_[i].moved = crossed || !before[i].same_as(pieces_[i]);
        }
    }

    const Piece<D>& piece(int i) const { return pieces_[static_cast<std::size_t>(i)]; }

    void note(const Piece<D>& a, const Piece<D>& b) {
        places_.push_back(a.place);
        places_.push_back(b.place);
        if (a.place.component == b.place.component) loops_.emplace_back(a.place, b.place);
    }

    // kPieces chords between two samples.
    Outline outline(const Piece<D>& a) const {
        const std::array<Vec2, D + 1> points = patch_of<D>(components_[a.place.component], a.place.first);
        Outline line;
        for (std::size_t k = 0; k < D; ++k) {
            line[k * kPieces] = points[k];
            for (std::size_t j = 1; j < kPieces; ++j) {
                line[k * kPieces + j] = apply<D>(kBasis<D>.between[k][j * Basis<D>::kSub / kPieces], points);
            }
        }
        line[kPoints - 1] = points[D];
        return line;
    }

    // Do two patches without a common joint cross? If they bend too much for their outlines to tell, and lie near
    // enough, they get a fine test.
    bool cross(const Piece<D>& a, const Piece<D>& b) {
        const Outline p = outline(a), q = outline(b);
        if (touch(p, q, 0.0)) return true;
        const double bend = sagitta(p) + sagitta(q);
        constexpr auto any = [](std::size_t, std::size_t) { return true; };
        if (bend < kFlat || !any_meeting(p, q, kBendMargin * bend, any)) return false;
        tests_ += kFineTests * D;
        return cross_finely(a, b);
    }

    // Two patches that turn back at their joint may cross so near to it that their outlines miss it or, if one leaves
    // it backwards, nearer than a fine test resolves.
    bool cusp(const Piece<D>& a, const Piece<D>& b) {
        if (dot(a.leaving(), b.entering()) >= 0) return false;
        tests_ += kJointTests;
        if (exhausted()) return false;
        const Fine last = finely(a, D - 1), first = finely(b, 0);
        if (dot(a.leaving(), last.back() - last.front()) < 0) return true;
        return dot(b.entering(), first.back() - first.front()) < 0 || touch(last, first, kTouch);
    }

    // Does one of two patches with a common joint return to the other beside it, where their outlines miss it?
    bool come_back(const Piece<D>& a, const Piece<D>& b) {
        tests_ += kJointTests * D;
        if (exhausted()) return false;
        for (std::size_t k = 1; k < D && !b.onward; ++k) {
            if (touch(finely(a, D - 1), finely(b, k), 0.0)) return true;
        }
        for (std::size_t k = 0; k + 1 < D && !a.onward; ++k) {
            if (touch(finely(a, k), finely(b, 0), 0.0)) return true;
        }
        return false;
    }

    bool crosses_itself(const Piece<D>& a) {
        tests_ += kOwnTests * D;
        if (exhausted()) return false;
        constexpr std::size_t kStride = 2, kCount = D * kFine / kStride;
        std::array<Vec2, kCount + 1> curve;
        for (std::size_t k = 0; k < D; ++k) {
            const Fine part = finely(a, k);
            for (std::size_t j = 0; j <= kFine; j += kStride) curve[(k * kFine + j) / kStride] = part[j];
        }
        for (std::size_t i = 0; i + 3 <= kCount; ++i) {
            for (std::size_t j = i + 2; j < kCount; ++j) {
                if (segments_cross(curve[i], curve[i + 1], curve[j], curve[j + 1])) return true;
            }
        }
        return false;
    }

    const std::vector<Samples>& components_;
    std::vector<std::pair<Place, Place>> loops_;
    std::vector<Place> places_;
    std::size_t tests_ = 0;  // of pairs so far
    std::vector<Piece<D>> pieces_;
    std::vector<std::pair<double, int>> order_;
    topology::Strip strip_;
};

}  // namespace ffseg::settling
