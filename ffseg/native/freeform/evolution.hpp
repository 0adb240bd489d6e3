// The free-form active contour: Algorithms 2, 3 and 4 of the paper on a pool of Bezier patches.
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/picture.hpp"
#include "common/stop.hpp"
#include "common/vec.hpp"

namespace ffseg::freeform {

// The ground plane in square cells; without cells the plane is the image itself.
struct Plane {
    const std::int32_t* cells = nullptr;  // of each pixel, row << 16 | column; negative if it shows no ground
    int side = 0;                         // cells
};

struct EvolutionOptions {  // defaults live with the parameters
    int degree = 0;
    double split_threshold = 0.0;  // px, largest distance between control points of one patch
    double balloon = 0.0;          // px per iteration, > 0
    bool refine = false;
    bool topology = false;
    int max_iterations = 0;
    std::size_t budget = 0;  // patches moved or examined; 0: no limit
    double clearance = 0.0;  // px, or cells of the plane
    double settle = 0.0;     // px, reach of the attraction to the ridge; 0 switches it off
    double ridge_low = 0.0;  // stored units: gradients below it are no ridge
    double weight = 0.0;     // of colours in the pressure
    double window = 0.0;     // px, see region::Pressure
    Plane plane;             // of the clearance, read while an evolution is made
};

struct EvolutionCounts {
    int iterations = 0, splits = 0, prunes = 0, flips = 0, merges = 0, drops = 0;
};

// Closed contours as runs of control points: contour c owns points[offsets[c] .. offsets[c + 1]).
struct ContourSet {
    std::vector<Vec2> points;
    std::vector<std::size_t> offsets{0};
};

struct GradientView {
    const std::uint16_t* data;
    int height, width;
};

class Evolution {
public:
    virtual ~Evolution() = default;
    // Runs at most `iterations` iterations; false once the contour has stopped.
    virtual bool advance(int iterations) = 0;
    // Attracts the stopped contour to the ridge of the gradient (the paper's attraction to edges).
    virtual void settle(const GradientView& gradient) = 0;
    virtual ContourSet contours() const = 0;
    virtual const EvolutionCounts& counts() const = 0;
    virtual Stop stop_reason() const = 0;
    // Work done, in units of the budget.
    virtual std::size_t work() const = 0;
};

// `starts`: control points of closed contours of degree options.degree, free space on the side of positive area.
// The edge and domain arrays are read here only. `colours`: the image whose colours take part in the pressure, of the
// edge map's size and kept as long as the evolution; or none. Throws std::invalid_argument.
std::unique_ptr<Evolution> make_evolution(const ContourSet& starts, const std::uint8_t* edges,
                                          const std::uint8_t* domain, int height, int width,
                                          const EvolutionOptions& options, const Picture& colours);

}  // namespace ffseg::freeform
