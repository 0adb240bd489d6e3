#include "baselines/levelset/outline.hpp"

#include <algorithm>
#include <cstring>

namespace ffseg::levelset {
namespace {

// Sides of a node, turning clockwise on the screen: up, right, down, left. An outline runs along the next side.
constexpr int kSides = 4;
constexpr int kDx[kSides] = {0, 1, 0, -1};
constexpr int kDy[kSides] = {-1, 0, 1, 0};

// Crossings keep this far from both nodes, so that a pixel centre never lies on the outline.
constexpr double kMargin = 1.0 / 64.0;

// Whether none of eight nodes in a row, 1 or 0 each, is inside below one that is not.
bool no_upper_side(const std::uint8_t* nodes, std::size_t stride) {
    std::uint64_t here, above;
    std::memcpy(&here, nodes, sizeof here);
    std::memcpy(&above, nodes - stride, sizeof above);
    return (here & ~above) == 0;
}

}  // namespace

GradientPlane::GradientPlane(marching::Grid grid, const std::uint16_t* gradient, int stop)
    : levels_(grid.size()), stop_(stop) {
    const std::int32_t stride = grid.stride();
    for (int y = -1; y <= grid.height; ++y) {
        const std::uint16_t* row =
            gradient + static_cast<std::ptrdiff_t>(std::clamp(y, 0, grid.height - 1)) * grid.width;
        std::uint16_t* out = levels_.data() + static_cast<std::ptrdiff_t>(y + 1) * stride;
        out[0] = row[0];
        std::copy_n(row, grid.width, out + 1);
        out[stride - 1] = row[grid.width - 1];
    }
}

Region::Region(const marching::March& march) : grid(march.grid), inside(march.grid.size()) {
    for (const std::int32_t node : march.start) inside[node] = 1;
    for (const std::int32_t node : march.order) inside[node] = 1;
}

Region::Region(marching::Grid size, const std::uint8_t* mask) : grid(size), inside(size.size()) {
    for (int y = 0; y < grid.height; ++y) {
        std::uint8_t* row = inside.data() + grid.node(0, y);
        for (int x = 0; x < grid.width; ++x) row[x] = *mask++ != 0;
    }
}

void Region::surround(const std::uint8_t* domain) {
    for (std::int32_t node = 0; node < static_cast<std::int32_t>(grid.size()); ++node) {
        if (!pixel(node)) inside[node] = 1;
    }
    if (domain == nullptr) return;
    for (int y = 0; y < grid.height; ++y) {
        for (int x = 0; x < grid.width; ++x) {
            if (*domain++ == 0) inside[grid.node(x, y)] = 1;
        }
    }
}

std::int32_t Region::step(int side) const { return kDy[side] * grid.stride() + kDx[side]; }

bool Region::rises(std::int32_t node, const GradientPlane& gradient) const {
    int along = 0;
    for (int side = 0; side < kSides; ++side) {
        if (inside[node - step(side)]) along += gradient.rise(node, step(side));
    }
    return along > 0;
}

bool Region::pixel(std::int32_t node) const {
    const int x = grid.x(node), y = grid.y(node);
    return x >= 0 && y >= 0 && x < grid.width && y < grid.height;
}

void Region::climb(const std::vector<std::int32_t>& on_contour, const GradientPlane& gradient,
                   const std::uint8_t* domain, int reach) {
    const auto open = [&](std::int32_t node) {
        return !inside[node] && gradient.on_edge(node) && pixel(node) &&
               (domain == nullptr || domain[static_cast<std::ptrdiff_t>(grid.y(node)) * grid.width + grid.x(node)]);
    };
    std::vector<std::int32_t> level = on_contour, risen;
    for (int depth = 0; depth < reach && !level.empty(); ++depth) {
        risen.clear();
        for (const std::int32_t node : level) {
            if (rises(node, gradient)) risen.push_back(node);
        }
        level.clear();
        for (const std::int32_t node : risen) inside[node] = 1;
        for (const std::int32_t node : risen) {
            for (int side = 0; side < kSides; ++side) {
                if (open(node + step(side))) level.push_back(node + step(side));
            }
        }
        std::sort(level.begin(), level.end());
        level.erase(std::unique(level.begin(), level.end()), level.end());
    }
}

Vec2 Region::crossing(std::int32_t node, int side, const GradientPlane* gradient) const {
    const std::int32_t other = node + step(side);
    double share = 0.5;
    // A region that surrounds the image reaches into the ring, where there is no gradient.
    if (gradient != nullptr && pixel(node) && pixel(other) && (gradient->on_edge(node) || gradient->on_edge(other))) {
        const int here = gradient->rise(node, step(side)), there = gradient->rise(other, step(side));
        const bool before = here > 0, beyond = there <= 0;  // of the ridge
        share = before && beyond ? static_cast<double>(here) / (here - there) : (before ? 1.0 : 0.0);
        share = std::clamp(share, kMargin, 1.0 - kMargin);
    }
    return {grid.x(node) + share * kDx[side], grid.y(node) + share * kDy[side]};
}

std::vector<Vec2> Region::trace(std::int32_t node, const GradientPlane* gradient,
                                std::vector<std::uint8_t>& seen) const {
    std::vector<Vec2> outline;
    const std::int32_t first = node;
    int side = 0;
    do {
        if (side == 0) seen[node] = 1;
        outline.push_back(crossing(node, side, gradient));
        const int turn = (side + 1) % kSides;
        const std::int32_t ahead = node + step(turn), beyond = ahead + step(side);
        if (!inside[ahead]) {
            side = turn;
        } else if (!inside[beyond]) {
            node = ahead;
        } else {
            node = beyond;
            side = (side + 3) % kSides;
        }
    } while (node != first || side != 0);
    return outline;
}

std::vector<std::vector<Vec2>> Region::outlines(const GradientPlane* gradient) const {
    std::vector<std::vector<Vec2>> found;
    std::vector<std::uint8_t> seen(grid.size());
    const auto stride = static_cast<std::size_t>(grid.stride());
    for (std::size_t node = stride; node < grid.size(); ++node) {  // every outline has an upper side somewhere
        while (node + 8 <= grid.size() && no_upper_side(&inside[node], stride)) node += 8;
        if (node == grid.size()) break;
        if (!inside[node] || inside[node - stride] || seen[node]) continue;
        found.push_back(trace(static_cast<std::int32_t>(node), gradient, seen));
    }
    return found;
}

}  // namespace ffseg::levelset
