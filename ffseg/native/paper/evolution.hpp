// Free form active contour deformation (Algorithm 4): split, flip, move, until almost nothing moves any more.
#pragma once
#include <cstdint>
#include <vector>

#include "common/stop.hpp"
#include "paper/contour.hpp"

namespace ffseg::paper {

// What moves the contour. Differs nowhere from Section 3.2, but that section gives no formula for the attraction.
struct Force {
    double balloon;   // px per iteration along the normal, where F_diff is 1
    double exponent;  // p of F_edge = |grad (G_sigma * I)|^p (Eq. 8)
    double
        sigma;  // px; ln |grad| of a smoothed step is -x^2 / (2 sigma^2), so sigma^2 times its slope leads to the edge
};

struct Limits {
    double split_threshold;
    bool refine, topology;
    int max_iterations;
};

// The edge map: gradient magnitude, edges, and where the contour may go.
class Field {
public:
    // Copies (H x W) arrays; `gradient` in 1/32 grey level per px, edges nonzero, domain (may be null) zero where
    // barred.
    Field(const std::uint16_t* gradient, const std::uint8_t* edges, const std::uint8_t* domain, int height, int width);

    double gradient(Vec2 p) const;  // bilinear, of the nearest place in the image
    bool homogeneous(Vec2 p) const;  // no edge among the nine pixels round p
    bool allowed(Vec2 p) const;  // in the image and the domain

private:
    std::size_t pixel(int x, int y) const;

    int height_, width_;
    std::vector<double> gradient_;
    std::vector<std::uint8_t> near_edge_, domain_;
};

// Moves every sample (Section 3.2), then every control point by V^-1 of that (Eq. 7); how many samples moved, of all.
struct Moved {
    std::size_t moved, samples;
};
Moved move(Contour& contour, const Field& field, const Force& force);

class Evolution {
public:
    Evolution(Contour contour, Field field, Force force, Limits limits);

    bool advance(int iterations);  // at most so many; false once it has stopped
    Contour& contour() { return contour_; }
    Moved step();  // one iteration
    Stop stop() const { return stop_; }

private:
    Contour contour_;
    Field field_;
    Force force_;
    Limits limits_;
    Stop stop_ = Stop::kRunning;
};

}  // namespace ffseg::paper
