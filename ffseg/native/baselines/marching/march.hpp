// Fast marching (Sethian): the time at which a front that only grows reaches each pixel, |grad T| = 1 / speed.
#pragma once
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "baselines/marching/queue.hpp"

namespace ffseg::marching {

// Pixels with one ring of barred nodes round them: node = (y + 1) * stride + x + 1, in raster order.
struct Grid {
    int height, width;
    std::int32_t stride() const { return width + 2; }
    std::size_t size() const { return (static_cast<std::size_t>(height) + 2) * (static_cast<std::size_t>(width) + 2); }
    std::int32_t node(int x, int y) const { return (y + 1) * stride() + x + 1; }
    int x(std::int32_t node) const { return node % stride() - 1; }
    int y(std::int32_t node) const { return node / stride() - 1; }
};

// Slowness (1 / speed) of a node; infinite where the speed is close to zero. One per node.
struct SlownessPlane {
    const double* values;
    double operator()(std::int32_t node) const { return values[node]; }
};

// The same through a table, for gradients kept as small integers.
struct SlownessTable {
    const std::uint16_t* levels;
    const double* table;
    double operator()(std::int32_t node) const { return table[levels[node]]; }
};

// Root of the first-order upwind scheme: a, b are the smallest accepted neighbours' times along x and y.
inline double upwind(double a, double b, double slowness) {
    const double gap = a - b;
    if (!(std::abs(gap) < slowness)) return std::min(a, b) + slowness;
    return 0.5 * (a + b + std::sqrt(2.0 * slowness * slowness - gap * gap));
}

class March {
public:
    // Nodes that are zero in `domain` (may be null) are never entered.
    March(Grid grid, const std::uint8_t* domain);

    // Nodes that are nonzero in `inside` are accepted at time 0, unless barred.
    void accept(const std::uint8_t* inside);

    // Makes the narrow band.
    template <class Slowness>
    void begin(const Slowness& slowness, ArrivalQueue& queue) {
        for (const std::int32_t node : start) touch_round(slowness, {0.0, node}, queue);
    }

    // Accepts the first node of the narrow band until the band is empty.
    template <class Slowness>
    void run(const Slowness& slowness, ArrivalQueue& queue) {
        Arrival next{};
        while (queue.pop(next)) {
            order.push_back(next.node);
            touch_round(slowness, next, queue);
        }
    }

    Grid grid;
    // Accepted nodes: arrival; narrow band: trial; far nodes: infinite. NaN on barred and on-contour nodes.
    std::vector<double> time;
    std::vector<std::int32_t> start;       // nodes accepted before the march
    std::vector<std::int32_t> order;       // nodes accepted by the march, first to last
    std::vector<std::int32_t> on_contour;  // potentially on contour nodes, in the order they were met
    std::size_t met = 0;                   // nodes that were ever in the narrow band

private:
    static constexpr double kNever = std::numeric_limits<double>::infinity();

    template <class Slowness>
    void touch_round(const Slowness& slowness, Arrival from, ArrivalQueue& queue) {
        for (const std::int32_t step : {-grid.stride(), -1, 1, grid.stride()}) {
            const std::int32_t node = from.node + step;
            if (!(time[node] > from.time)) continue;  // accepted, barred or on contour
            const double a = std::min(known(node - 1, from.time), known(node + 1, from.time));
            const double b = std::min(known(node - grid.stride(), from.time), known(node + grid.stride(), from.time));
            offer(node, upwind(a, b, slowness(node)), queue);
        }
    }

    void offer(std::int32_t node, double arrival, ArrivalQueue& queue) {
        if (arrival < time[node]) {
            met += std::isinf(time[node]);
            time[node] = arrival;
            queue.push(node);
        } else if (std::isinf(arrival)) {
            time[node] = std::numeric_limits<double>::quiet_NaN();
            on_contour.push_back(node);
        }
    }

    // Time of a node the front has reached by `now`; what is not accepted yet lies later.
    double known(std::int32_t node, double now) const { return time[node] <= now ? time[node] : kNever; }
};

// The size of buckets that keep a queue short at this slowness: a fraction of the time it takes to cross a pixel.
template <class Slowness>
double bucket_width(const Grid& grid, const Slowness& slowness) {
    constexpr std::size_t kStride = 61;        // every 61st node: some thousands of samples in a usual image
    constexpr double kBucketsPerPixel = 128.0;  // measured: 64 to 256 are alike, 8 takes half as much time again
    std::vector<double> sample;
    for (std::size_t node = 0; node < grid.size(); node += kStride) {
        const double s = slowness(static_cast<std::int32_t>(node));
        if (std::isfinite(s)) sample.push_back(s);
    }
    if (sample.empty()) return 1.0;
    const auto middle = sample.begin() + static_cast<std::ptrdiff_t>(sample.size() / 2);
    std::nth_element(sample.begin(), middle, sample.end());
    return *middle / kBucketsPerPixel;
}

}  // namespace ffseg::marching
