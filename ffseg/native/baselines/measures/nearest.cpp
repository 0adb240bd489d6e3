#include "baselines/measures/nearest.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ffseg::measures {

// The others from left to right are looked at from the point on, to either side in turn, until none can be nearer.
std::vector<double> nearest_distances(const std::vector<Vec2>& points, const std::vector<Vec2>& others) {
    std::vector<Vec2> sorted = others;
    std::sort(sorted.begin(), sorted.end(), [](Vec2 a, Vec2 b) { return a.x < b.x; });
    std::vector<double> distances;
    distances.reserve(points.size());
    for (const Vec2 p : points) {
        auto right = std::lower_bound(sorted.cbegin(), sorted.cend(), p.x, [](Vec2 q, double x) { return q.x < x; });
        auto left = right;
        double best = std::numeric_limits<double>::infinity();
        const auto may_be_nearer = [&](Vec2 q) { return (q.x - p.x) * (q.x - p.x) < best; };
        for (bool any = true; any;) {
            any = false;
            if (right != sorted.cend() && may_be_nearer(*right)) {
                best = std::min(best, norm2(*right++ - p));
                any = true;
            }
            if (left != sorted.cbegin() && may_be_nearer(left[-1])) {
                best = std::min(best, norm2(*--left - p));
                any = true;
            }
        }
        distances.push_back(std::sqrt(best));
    }
    return distances;
}

}  // namespace ffseg::measures
