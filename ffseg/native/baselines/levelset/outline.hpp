// From the nodes a march accepted to closed outlines: climb the edges the front stopped at, then trace the ridge.
#pragma once
#include <cstdint>
#include <vector>

#include "baselines/marching/march.hpp"
#include "common/vec.hpp"

namespace ffseg::levelset {

// The gradient magnitude on the nodes of a grid, the ring repeating the border pixels.
class GradientPlane {
public:
    // Nodes at or above `stop` are on an edge.
    GradientPlane(marching::Grid grid, const std::uint16_t* gradient, int stop);
    bool on_edge(std::int32_t node) const { return level(node) >= stop_; }
    const std::uint16_t* levels() const { return levels_.data(); }
    int level(std::int32_t node) const { return levels_[static_cast<std::size_t>(node)]; }
    // Twice the central difference along a step to a neighbouring node; the node must not lie in the ring.
    int rise(std::int32_t node, std::int32_t step) const { return level(node + step) - level(node - step); }

private:
    std::vector<std::uint16_t> levels_;
    int stop_;
};

// The region behind a front: `inside` is 1 on its nodes.
class Region {
public:
    explicit Region(const marching::March& march);
    // Pixels that are nonzero in a mask, (H, W).
    Region(marching::Grid size, const std::uint8_t* mask);

    // For a front that closes in: all that lies outside the image or the domain (may be null) joins the region.
    void surround(const std::uint8_t* domain);

    // The front stopped where the edge begins. It now climbs: a node on an edge joins the region while the gradient
    // still rises along the front's way. At most `reach` nodes deep; it never comes down on the far side. Nodes
    // outside the domain (may be null) stay outside.
    void climb(const std::vector<std::int32_t>& on_contour, const GradientPlane& gradient, const std::uint8_t* domain,
               int reach);

    // Closed outlines through the ridge between a node inside and its neighbour outside, half-way where there is none.
    // Outer ones have positive shoelace area. Nodes touching at a corner only are not connected.
    std::vector<std::vector<Vec2>> outlines(const GradientPlane* gradient) const;

    marching::Grid grid;
    std::vector<std::uint8_t> inside;

private:
    bool pixel(std::int32_t node) const;
    bool rises(std::int32_t node, const GradientPlane& gradient) const;
    std::vector<Vec2> trace(std::int32_t node, const GradientPlane* gradient, std::vector<std::uint8_t>& seen) const;
    Vec2 crossing(std::int32_t node, int side, const GradientPlane* gradient) const;
    std::int32_t step(int side) const;
};

}  // namespace ffseg::levelset
