// The parametric snake (PM): Kass's internal energy, Cohen's balloon, an edge force, distance-based refinement.
#pragma once
#include <cstdint>
#include <vector>

#include "baselines/snake/cyclic.hpp"
#include "common/stop.hpp"
#include "common/vec.hpp"

namespace ffseg::snake {

// Defaults live with the parameters.
struct SnakeOptions {
    double tension = 0.0, rigidity = 0.0;  // weights of first and second differences
    double balloon = 0.0;                  // px per iteration; negative closes in
    double attraction = 0.0;  // px^2; the edge force is attraction * grad ln |grad I| along the normal
    double spacing = 0.0;     // px; longer stretches get a point, a third of it loses one
    double tolerance = 0.0;   // px; points that move less have stopped
    bool refine = false;
    int max_iterations = 0;
    std::size_t budget = 0;  // points moved; 0: no limit
};

// A matched interest point of a camera pair: points of low altitude switch off the edges within `radius` px, points
// of high altitude double them (Eq. 11).
struct AltitudePoint {
    Vec2 at;
    double radius;
    bool low;
};

// What pushes and stops a snake. Arrays are (H, W) and outlive it.
struct SnakeField {
    const std::uint16_t* gradient;
    int height, width;
    const std::uint8_t* domain;  // zero where the snake may not go; may be null
    std::vector<std::uint8_t> zone;  // SnakeZone of each pixel

    Vec2 clamp(Vec2 p) const;
    std::size_t pixel(Vec2 p) const;  // of a clamped point
    bool barred(Vec2 p) const { return domain != nullptr && domain[pixel(p)] == 0; }
};

// Swept pixels are homogeneous ones the snake has moved over: two fronts that meet stop there.
enum SnakeZone : std::uint8_t { kHomogeneous = 0, kEdge = 1, kStrongEdge = 2, kSwept = 3 };

// Zones from thin edges, widened so that the edge force finds the ridge from all over an edge zone.
std::vector<std::uint8_t> snake_zones(const std::uint8_t* edges, int height, int width,
                                      const std::vector<AltitudePoint>& points);

struct SnakeCounts {
    int iterations = 0, insertions = 0, removals = 0;
    std::size_t moved = 0;  // points, in all iterations
};

class Snake {
public:
    Snake(SnakeField field, std::vector<Vec2> points, const SnakeOptions& options);

    // Runs up to `most` iterations; false once the snake has stopped.
    bool advance(int most);

    const std::vector<Vec2>& points() const { return points_; }
    Stop stop() const { return stop_; }
    const SnakeCounts& counts() const { return counts_; }

private:
    void step();
    Vec2 normal(std::size_t i) const;
    Vec2 force(std::size_t i) const;
    double free_way(Vec2 from, Vec2 way) const;
    Vec2 gradient(Vec2 p, double& level) const;
    Vec2 move(Vec2 from, Vec2 to) const;
    void sweep(Vec2 a, Vec2 b, Vec2 c, Vec2 d);
    bool refine();

    SnakeField field_;
    SnakeOptions options_;
    CyclicSystem system_;
    std::vector<Vec2> points_, next_, normals_;
    SnakeCounts counts_;
    int quiet_ = 0;
    Stop stop_ = Stop::kRunning;
};

}  // namespace ffseg::snake
