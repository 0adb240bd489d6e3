// Settled contours that still cross themselves or each other are smoothed and drawn back until they do not.
#pragma once
#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

#include "freeform/settling/crossings.hpp"
#include "freeform/settling/nesting.hpp"

namespace ffseg::settling {

// Rounds of smoothing; a crossing of two contours on one ridge needs one or two.
constexpr int kUntangleRounds = 24;
// Rounds after which remaining loops are cut off.
constexpr int kSmoothingRounds = 8;
// Rounds after which a component that still crosses itself is divided at the crossing.
constexpr int kDivideRound = 16;
// A component of at most this many samples that still winds over itself then is replaced by its convex hull, and
// dropped if that crosses something, too.
constexpr std::size_t kSmallComponent = 64;
// Samples that may be re-laid in one round of cutting loops, as a multiple of all samples.
constexpr std::size_t kMaxLaid = 64;
// Parts with fewer patches form no component.
constexpr std::size_t kMinPatches = 2;
// Pixels drawn back along the normal in each round.
constexpr double kDrawBack = 0.25;

// Do both parts of a component that crosses itself bound the region? They do if they lie apart with the same
// orientation, or if one is a hole of the other: the front has met itself behind an obstacle.
inline bool both_bound(const Samples& a, const Samples& b) {
    const double one = twice_area(a), two = twice_area(b);
    const bool first = std::abs(one) > std::abs(two), hole = (one > 0) != (two > 0);
    const Samples &larger = first ? a : b, &smaller = first ? b : a;
    return holds(larger, smaller[smaller.size() / 2]) == hole && (!hole || (first ? one : two) > 0);
}

// A small component that winds over itself becomes its convex hull, with the same orientation.
inline void replace_by_hull(Samples& at) {
    Samples sorted = at;
    std::sort(sorted.begin(), sorted.end(), [](Vec2 a, Vec2 b) { return a.x != b.x ? a.x < b.x : a.y < b.y; });
    const bool backwards = twice_area(at) < 0;
    Samples hull;
    for (int side = 0; side < 2; ++side) {  // Andrew's monotone chain
        const std::size_t base = hull.size();
        for (const Vec2 p : sorted) {
            while (hull.size() >= base + 2 && ffseg::cross(hull.back() - hull[hull.size() - 2], p - hull.back()) <= 0) {
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

template <int D>
class Untangle {
public:
    explicit Untangle(std::vector<Samples>& components) : components_(components), crossings_(components) {}

    // True once no curve crosses another (curves as polygons of several segments between samples).
    bool run() {
        for (int round = 0; round < kUntangleRounds; ++round) {
            crossings_.find();
            if (crossings_.places().empty()) return true;
            if (crossings_.exhausted()) break;
            for (const Place& place : crossings_.places()) smooth(place);
            if (round < kSmoothingRounds) continue;
            const Loops obstacles = cut_loops();
            divide(round == kDivideRound ? crossings_.loops() : obstacles);
        }
        crossings_.restart();  // small components that wind over themselves may have used up the tests
        crossings_.find();
        for (const Place& place : crossings_.places()) {
            if (components_[place.component].size() <= kSmallComponent) replace_by_hull(components_[place.component]);
        }
        if (!crossings_.places().empty()) crossings_.find();
        while (components_.size() > 1 && drop_smallest()) crossings_.find();
        return crossings_.places().empty();
    }

private:
    using Loops = std::vector<std::pair<Place, Place>>;

    // Drops the smallest component that crosses something, if it is small.
    bool drop_smallest() {
        const auto size = [this](const Place& place) { return components_[place.component].size(); };
        const auto less = [&](const Place& a, const Place& b) { return size(a) < size(b); };
        const auto least = std::min_element(crossings_.places().begin(), crossings_.places().end(), less);
        if (least == crossings_.places().end() || size(*least) > kSmallComponent) return false;
        components_.erase(components_.begin() + static_cast<std::ptrdiff_t>(least->component));
        return true;
    }

    // Smooths the samples of a patch and draws them back towards the region.
    void smooth(const Place& place) {
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

    // Cuts loops, but not all in one round of a contour that crosses itself everywhere. Returns the loops round
    // obstacles, which are kept: their ground would become free.
    Loops cut_loops() {
        Loops obstacles;
        std::size_t samples = 0, laid = 0;
        for (const Samples& component : components_) samples += component.size();
        for (const auto& [from, to] : crossings_.loops()) {
            const std::size_t n = components_[from.component].size(),
                              span = from.first < to.first ? to.first - from.first : from.first - to.first;
            const bool whole = std::min(span, n - span) >= (kMinPatches + 1) * D;  // may become a component
            if (whole) laid += n;
            if (whole && holds_obstacle(from, to)) {
                obstacles.emplace_back(from, to);
            } else {
                laid += cut(from, to);
            }
            if (laid > kMaxLaid * samples) break;
        }
        return obstacles;
    }

    // Does the shorter part between two crossing patches of one component enclose an obstacle?
    bool holds_obstacle(Place from, Place to) const {
        const auto [part, rest] = parts(from, to);
        return twice_area(part.size() < rest.size() ? part : rest) < 0 && both_bound(part, rest);
    }

    // The part between two crossing patches of one component, and the rest of it, both without these patches.
    std::pair<Samples, Samples> parts(Place from, Place to) const {
        const Samples& at = components_[from.component];
        const auto low = at.begin() + static_cast<std::ptrdiff_t>(std::min(from.first, to.first));
        const auto high = at.begin() + static_cast<std::ptrdiff_t>(std::max(from.first, to.first));
        Samples part, rest(at.begin(), low);
        if (high - low > D) part.assign(low + D, high);
        rest.insert(rest.end(), high + D, at.end());
        return {std::move(part), std::move(rest)};
    }

    // Lays the shorter part between two crossing patches of one component on its chord. Returns the number of samples.
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

    // Divides a component at a crossing without a loop that could be cut off, leaving out the crossing patches; if not
    // both parts bound the region, only the larger one is kept.
    void divide(const Loops& loops) {
        std::vector<Samples> made;
        std::vector<bool> divided(components_.size(), false);
        for (const auto& [from, to] : loops) {
            if (divided[from.component]) continue;
            auto [part, rest] = parts(from, to);
            if (std::min(part.size(), rest.size()) < kMinPatches * D) continue;
            divided[from.component] = true;
            const bool both = both_bound(part, rest);
            if (std::abs(twice_area(part)) > std::abs(twice_area(rest))) std::swap(part, rest);
            components_[from.component] = std::move(rest);
            if (both) made.push_back(std::move(part));
        }
        std::move(made.begin(), made.end(), std::back_inserter(components_));
    }

    std::vector<Samples>& components_;
    Crossings<D> crossings_;
};

}  // namespace ffseg::settling
