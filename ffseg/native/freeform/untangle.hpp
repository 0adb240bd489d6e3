// Settled contours that still cross themselves or each other are smoothed and drawn back there until they do not.
#pragma once
#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

#include "freeform/settle.hpp"
#include "freeform/strips.hpp"

namespace ffseg::freeform {

// Rounds of smoothing; a crossing of two contours on one ridge needs one or two.
constexpr int kUntangleRounds = 24;
// Loops that are still there after so many rounds are cut off.
constexpr int kEaseRounds = 8;
// A component that still crosses itself after so many is divided there.
constexpr int kDivideRound = 16;
// A component of at most so many samples that is still wound up then is replaced by its convex hull.
constexpr std::size_t kSpeck = 64;
// Pairs of patches looked at in all, to a patch; few patches share what kFewPieces may have. To each degree a fine look
// at two patches or at one counts as so many, one at their joint as kJointLook. A settled contour needs two or three a
// round; what runs over itself everywhere is not worth more.
constexpr std::size_t kLooks = 128, kFewPieces = 1024, kFineLook = 128, kOwnLook = 64, kJointLook = 32;
// Curves nearer to each other than this touch, as far as anyone can draw them.
constexpr double kTouch = 0.01;
// What turns by less, up to rounding, does not cross itself.
constexpr double kHalfTurn = 3.14159;
// Outlines that lie so near to their curves show where these cross.
constexpr double kFlat = 0.001;
// In one round loops are cut until so many times the samples there are have been laid anew.
constexpr std::size_t kMostLaid = 64;
// Pixels drawn back along the normal in each round.
constexpr double kDrawBack = 0.25;

template <int D>
class Untangle {
public:
    explicit Untangle(std::vector<Samples>& components) : components_(components) {}

    // True when no curve crosses any more (curves as polygons of kPieces segments between two samples).
    bool run() {
        for (int round = 0; round < kUntangleRounds; ++round) {
            find_crossings();
            if (crossing_.empty()) return true;
            if (tired()) break;
            for (const Place& place : crossing_) ease(place);
            if (round < kEaseRounds) continue;
            cut_loops();
            if (round == kDivideRound) divide();
        }
        looks_ = 0;  // what is small and wound up may have used them up
        find_crossings();
        for (const Place& place : crossing_) {
            if (components_[place.component].size() <= kSpeck) enclose(components_[place.component]);
        }
        if (!crossing_.empty()) find_crossings();
        return crossing_.empty();
    }

private:
    static constexpr int kPieces = D <= 3 ? 4 : 8;
    static constexpr int kPoints = D * kPieces + 1;
    static constexpr std::size_t kFine = 32;
    using Points = std::array<Vec2, D + 1>;
    using Outline = std::array<Vec2, kPoints>;
    using Fine = std::array<Vec2, kFine + 1>;
    struct Place {
        std::size_t component, first;  // the patch beginning at this sample
        bool operator<(const Place& o) const {
            return component != o.component ? component < o.component : first < o.first;
        }
        bool operator==(const Place& o) const { return component == o.component && first == o.first; }
    };
    struct Piece {
        Place place;
        int prev, next;  // in its component
        Points control;
        Box box;
        bool onward;  // the control polygon advances along its chord

        Vec2 entering() const { return control[1] - control[0]; }
        Vec2 leaving() const { return control[D] - control[D - 1]; }
    };

    void collect() {
        pieces_.clear();
        for (std::size_t c = 0; c < components_.size(); ++c) {
            const Samples& at = components_[c];
            const int begin = static_cast<int>(pieces_.size()), count = static_cast<int>(at.size() / D);
            for (int i = 0; i < count; ++i) {
                const std::size_t first = static_cast<std::size_t>(i) * D;
                Piece piece{{c, first}, begin + (i + count - 1) % count, begin + (i + 1) % count, {}, {}, true};
                const Points points = patch_of<D>(at, first);
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
    }

    void find_crossings() {
        collect();
        crossing_.clear();
        loops_.clear();
        order_.resize(pieces_.size());
        for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = {pieces_[i].box.x0, static_cast<int>(i)};
        std::sort(order_.begin(), order_.end());
        strip_.reset(pieces_.size());
        for (const auto& [left, i] : order_) strip_.push(piece(i).box, i, true);
        strip_.each_meeting([this](int i) { return std::array<int, 2>{piece(i).prev, piece(i).next}; },
                            [this](int i, int j) {
                                ++looks_;
                                if (tired()) return true;
                                if (cross(piece(i), piece(j))) note(piece(i), piece(j));
                                return false;
                            });
        for (const Piece& a : pieces_) {
            const Piece& b = piece(a.next);
            if (!a.onward && turning(a) >= kHalfTurn && crosses_itself(a)) note(a, a);
            const bool winding = !run_one_way(a, b) && turning(a) + turn(a.leaving(), b.entering()) + turning(b) >= kHalfTurn;
            if (winding && touch(outline(a), outline(b), 0.0)) note(a, b);
            if ((winding && come_back(a, b)) || cusp(a, b)) {
                crossing_.push_back(a.place);
                crossing_.push_back(b.place);
            }
        }
        std::sort(crossing_.begin(), crossing_.end());
        crossing_.erase(std::unique(crossing_.begin(), crossing_.end()), crossing_.end());
    }

    bool tired() const { return looks_ > kLooks * (pieces_.size() + kFewPieces); }
    const Piece& piece(int i) const { return pieces_[static_cast<std::size_t>(i)]; }

    void note(const Piece& a, const Piece& b) {
        crossing_.push_back(a.place);
        crossing_.push_back(b.place);
        if (a.place.component == b.place.component) loops_.emplace_back(a.place, b.place);
    }

    // The angle between two sides; one of no length may turn any way.
    static double turn(Vec2 u, Vec2 v) {
        const double across = ffseg::cross(u, v), along = dot(u, v);
        return across == 0 && along == 0 ? kHalfTurn : std::abs(std::atan2(across, along));
    }

    // The angles of the control polygon. A curve whose polygon turns by less than half a turn in all does not cross
    // itself, nor do two that meet.
    static double turning(const Piece& a) {
        double sum = 0.0;
        for (std::size_t k = 1; k < D; ++k) sum += turn(a.control[k] - a.control[k - 1], a.control[k + 1] - a.control[k]);
        return sum;
    }

    // Do two patches that meet advance along one direction? Then they cannot cross.
    static bool run_one_way(const Piece& a, const Piece& b) {
        const Vec2 along = b.control[D] - a.control[0];
        for (std::size_t k = 0; k < D; ++k) {
            if (!(dot(a.control[k + 1] - a.control[k], along) > 0 && dot(b.control[k + 1] - b.control[k], along) > 0)) {
                return false;
            }
        }
        return true;
    }

    // kPieces chords between two samples.
    Outline outline(const Piece& a) const {
        const Points points = patch_of<D>(components_[a.place.component], a.place.first);
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

    // How far a curve may lie from its outline: the sagitta of a chord.
    static double sagitta(const Outline& line) {
        double bend = 0.0;
        for (std::size_t i = 1; i + 1 < kPoints; ++i) {
            bend = std::max(bend, norm2(line[i + 1] - line[i] - (line[i] - line[i - 1])));
        }
        return 0.125 * std::sqrt(bend);
    }

    // Do two patches that do not meet cross? Where they bend so much that their outlines need not show it, they are
    // looked at finely.
    bool cross(const Piece& a, const Piece& b) {
        const Outline p = outline(a), q = outline(b);
        if (touch(p, q, 0.0)) return true;
        if (sagitta(p) + sagitta(q) < kFlat) return false;
        looks_ += kFineLook * D;
        return cross_finely(a, b);
    }

    // Two patches that turn back where they meet may cross so near to their joint that their outlines miss it, or, where
    // one leaves it backwards, nearer than a fine look shows.
    bool cusp(const Piece& a, const Piece& b) {
        if (dot(a.leaving(), b.entering()) >= 0) return false;
        looks_ += kJointLook;
        if (tired()) return false;
        const Fine last = finely(a, D - 1), first = finely(b, 0);
        if (dot(a.leaving(), last.back() - last.front()) < 0) return true;
        return dot(b.entering(), first.back() - first.front()) < 0 || touch(last, first, kTouch);
    }

    // Does one of two patches that meet come back to the other beside the joint, where their outlines miss it?
    bool come_back(const Piece& a, const Piece& b) {
        looks_ += kJointLook * D;
        if (tired()) return false;
        for (std::size_t k = 1; k < D && !b.onward; ++k) {
            if (touch(finely(a, D - 1), finely(b, k), 0.0)) return true;
        }
        for (std::size_t k = 0; k + 1 < D && !a.onward; ++k) {
            if (touch(finely(a, k), finely(b, 0), 0.0)) return true;
        }
        return false;
    }

    static bool cross_finely(const Piece& a, const Piece& b) {
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

    // Do two lines of chords cross, or come nearer than `near` to each other a little off the end of the first?
    template <std::size_t N>
    static bool touch(const std::array<Vec2, N>& p, const std::array<Vec2, N>& q, double near) {
        Box around;
        for (const Vec2 point : q) around.add(point);
        for (std::size_t i = 0; i + 1 < N; ++i) {
            Box box;
            box.add({std::min(p[i].x, p[i + 1].x) - near, std::min(p[i].y, p[i + 1].y) - near});
            box.add({std::max(p[i].x, p[i + 1].x) + near, std::max(p[i].y, p[i + 1].y) + near});
            if (!box.meets(around)) continue;
            const bool off_joint = norm2(p[i] - p.back()) > 25 * near * near;
            for (std::size_t j = 0; j + 1 < N; ++j) {
                Box other;
                other.add(q[j]);
                other.add(q[j + 1]);
                if (!box.meets(other)) continue;
                if (segments_cross(p[i], p[i + 1], q[j], q[j + 1])) return true;
                if (near > 0 && off_joint && distance2(p[i], q[j], q[j + 1]) < near * near) return true;
            }
        }
        return false;
    }

    // Squared distance from a point to a segment.
    static double distance2(Vec2 p, Vec2 a, Vec2 b) {
        const Vec2 along = b - a;
        const double size = norm2(along), t = size > 0 ? std::clamp(dot(p - a, along) / size, 0.0, 1.0) : 0.0;
        return norm2(p - (a + t * along));
    }

    // The curve of a patch from its sample k to the next.
    static Fine finely(const Piece& a, std::size_t k) {
        Fine curve;
        for (std::size_t j = 0; j <= kFine; ++j) {
            Points left = a.control;  // de Casteljau (Algorithm 1)
            const double t = (static_cast<double>(k) + static_cast<double>(j) / kFine) / D;
            for (std::size_t level = 1; level <= D; ++level) {
                for (std::size_t i = 0; i + level <= D; ++i) left[i] += t * (left[i + 1] - left[i]);
            }
            curve[j] = left[0];
        }
        return curve;
    }

    bool crosses_itself(const Piece& a) {
        looks_ += kOwnLook * D;
        if (tired()) return false;
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

    // Smooths the samples of a patch and draws them back, towards the region they bound.
    void ease(const Place& place) {
        Samples& at = components_[place.component];
        const std::size_t n = at.size();
        for (std::size_t k = 0; k <= D; ++k) {
            const std::size_t i = (place.first + k) % n;
            const Vec2 back = at[(i + n - 1) % n], ahead = at[(i + 1) % n];
            const Vec2 tangent = ahead - back;
            const double size = norm(tangent);
            at[i] = 0.5 * at[i] + 0.25 * (back + ahead);
            if (size > 0) at[i] += (kDrawBack / size) * Vec2{-tangent.y, tangent.x};
        }
    }

    // A contour that runs over itself everywhere has as many loops as pairs of patches: the next round finds the rest.
    void cut_loops() {
        std::size_t samples = 0, laid = 0;
        for (const Samples& component : components_) samples += component.size();
        for (const auto& [from, to] : loops_) {
            laid += cut(from, to);
            if (laid > kMostLaid * samples) break;
        }
    }

    // What lies between two crossing patches of one component, the shorter way round, is laid on its chord. Returns the
    // number of samples.
    std::size_t cut(Place from, Place to) {
        Samples& at = components_[from.component];
        const std::size_t n = at.size();
        std::size_t span = (to.first + n - from.first) % n;
        if (span > n / 2) {
            std::swap(from, to);
            span = n - span;
        }
        if (span + D >= n / 2) return 1;
        const Vec2 begin = at[from.first], end = at[(to.first + D) % n];
        for (std::size_t k = 1; k < span + D; ++k) {
            const double u = static_cast<double>(k) / static_cast<double>(span + D);
            at[(from.first + k) % n] = begin + u * (end - begin);
        }
        return span + D;
    }

    // A component that crosses itself far from any loop that can be cut off becomes two, without the crossing patches.
    // Of a component whose two parts run round in opposite ways only the larger one stays.
    void divide() {
        std::vector<Samples> made;
        std::vector<bool> divided(components_.size(), false);
        for (const auto& [from, to] : loops_) {
            Samples& at = components_[from.component];
            const std::size_t low = std::min(from.first, to.first), high = std::max(from.first, to.first);
            if (divided[from.component] || high - low < 3 * D || at.size() - (high - low) < 3 * D) continue;
            divided[from.component] = true;
            const auto begin = at.begin();
            Samples part(begin + static_cast<std::ptrdiff_t>(low + D), begin + static_cast<std::ptrdiff_t>(high));
            at.erase(begin + static_cast<std::ptrdiff_t>(low), begin + static_cast<std::ptrdiff_t>(high + D));
            const double mine = twice_area(part), rest = twice_area(at);
            if ((mine > 0) == (rest > 0)) {
                made.push_back(std::move(part));
            } else if (std::abs(mine) > std::abs(rest)) {
                at = std::move(part);
            }
        }
        std::move(made.begin(), made.end(), std::back_inserter(components_));
    }

    static double twice_area(const Samples& at) {
        double twice = 0.0;
        for (std::size_t i = 0; i < at.size(); ++i) {
            twice += ffseg::cross(at[i] - at[0], at[(i + 1) % at.size()] - at[0]);
        }
        return twice;
    }

    // A small component wound up on itself becomes its convex hull, of the same orientation.
    static void enclose(Samples& at) {
        Samples sorted = at;
        std::sort(sorted.begin(), sorted.end(),
                  [](Vec2 a, Vec2 b) { return a.x != b.x ? a.x < b.x : a.y < b.y; });
        const bool backwards = twice_area(at) < 0;
        Samples hull;
        for (int side = 0; side < 2; ++side) {  // Andrew's monotone chain
            const std::size_t base = hull.size();
            for (const Vec2 p : sorted) {
                while (hull.size() >= base + 2 &&
                       ffseg::cross(hull.back() - hull[hull.size() - 2], p - hull.back()) <= 0) {
                    hull.pop_back();
                }
                hull.push_back(p);
            }
            hull.pop_back();
            std::reverse(sorted.begin(), sorted.end());
        }
        if (backwards) std::reverse(hull.begin(), hull.end());
        Along along(hull.data(), hull.size(), true);
        const double step = along.length() / static_cast<double>(at.size());
        for (std::size_t k = 0; k < at.size(); ++k) at[k] = along.at(step * static_cast<double>(k));
    }

    std::vector<Samples>& components_;
    std::vector<std::pair<Place, Place>> loops_;
    std::size_t looks_ = 0;  // at pairs so far
    std::vector<Piece> pieces_;
    std::vector<std::pair<double, int>> order_;
    Strip strip_;
    std::vector<Place> crossing_;
};

}  // namespace ffseg::freeform
