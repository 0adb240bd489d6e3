#include "edges/boundary.hpp"

#include <algorithm>
#include <cmath>

#include "common/measures.hpp"

namespace ffseg::edges {
namespace {

// Whether a pixel outside the domain lies `margin` pixels beside the point, or at it; at the image's border, there.
bool near_outside(Vec2 at, const Limits& limits) {
    for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
            const double x = std::clamp(at.x + dx * limits.margin, 0.0, limits.width - 1.0);
            const double y = std::clamp(at.y + dy * limits.margin, 0.0, limits.height - 1.0);
            const auto row = static_cast<std::size_t>(std::rint(y)), column = static_cast<std::size_t>(std::rint(x));
            if (limits.domain[row * static_cast<std::size_t>(limits.width) + column] == 0) return true;
        }
    }
    return false;
}

bool within(Vec2 at, const Limits& limits) {
    const double least = limits.margin, right = limits.width - 1.0 - least, bottom = limits.height - 1.0 - least;
    if (at.x < least || at.y < least || at.x > right || at.y > bottom) return true;
    return limits.domain != nullptr && near_outside(at, limits);
}

}  // namespace

std::vector<std::uint16_t> gradients_at(const std::vector<Vec2>& joints, const std::uint16_t* gradient,
                                        const Limits& limits) {
    const auto width = static_cast<std::size_t>(limits.width);
    std::vector<std::uint16_t> found;
    for (const Vec2 joint : joints) {
        const Vec2 at{std::rint(joint.x), std::rint(joint.y)};
        if (within(at, limits)) continue;
        const std::uint16_t* row = gradient + (static_cast<std::size_t>(at.y) - 1) * width;
        row += static_cast<std::size_t>(at.x) - 1;
        std::uint16_t most = 0;
        for (int dy = 0; dy < 3; ++dy, row += width) most = std::max({most, row[0], row[1], row[2]});
        found.push_back(most);
    }
    return found;
}

double share_within(const std::vector<Vec2>& joints, const std::vector<std::size_t>& ends, const Limits& limits) {
    if (std::none_of(joints.begin(), joints.end(), [&](Vec2 at) { return within(at, limits); })) return 0.0;
    double along = 0.0, whole = 0.0;
    std::vector<double> lengths, inside;
    for (std::size_t c = 1; c < ends.size(); ++c) {
        lengths.clear();
        inside.clear();
        for (std::size_t i = ends[c - 1]; i < ends[c]; ++i) {
            const std::size_t next = i + 1 < ends[c] ? i + 1 : ends[c - 1];
            const Vec2 step = joints[next] - joints[i];
            lengths.push_back(std::hypot(step.x, step.y));
            if (within(joints[i], limits) && within(joints[next], limits)) inside.push_back(lengths.back());
        }
        along += pairwise_sum(inside.data(), inside.size());
        whole += pairwise_sum(lengths.data(), lengths.size());
    }
    return whole > 0 ? along / whole : 0.0;
}

}  // namespace ffseg::edges
