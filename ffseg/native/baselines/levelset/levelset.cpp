#include "baselines/levelset/levelset.hpp"

#include <algorithm>

#include "baselines/levelset/outline.hpp"

namespace ffseg::levelset {
namespace {

double shoelace(const std::vector<Vec2>& polygon) {
    double twice = 0.0;
    for (std::size_t i = 2; i < polygon.size(); ++i) {
        twice += cross(polygon[i - 1] - polygon[0], polygon[i] - polygon[0]);
    }
    return 0.5 * twice;
}

}  // namespace

LevelSetResult level_set(const LevelSetInput& input) {
    const GradientPlane gradient(input.grid, input.gradient, input.stop);
    const marching::SlownessTable slowness{gradient.levels(), input.slowness};
    marching::March march(input.grid, input.domain);
    march.accept(input.inside);
    marching::ArrivalQueue queue(marching::bucket_width(input.grid, slowness), march.time.data(), march.grid.stride());
    march.begin(slowness, queue);
    LevelSetResult result;
    result.initial_band = march.met;
    march.run(slowness, queue);
    result.accepted = march.order.size();
    result.on_contour = march.on_contour.size();
    Region region(march);
    region.climb(march.on_contour, gradient, input.domain, input.reach);
    if (input.closing_in) region.surround(input.domain);
    for (std::vector<Vec2>& outline : region.outlines(input.reach > 0 ? &gradient : nullptr)) {
        if (std::abs(shoelace(outline)) < input.min_area) continue;
        if (input.closing_in) std::reverse(outline.begin(), outline.end());
        result.points.insert(result.points.end(), outline.begin(), outline.end());
        result.offsets.push_back(result.points.size());
    }
    return result;
}

}  // namespace ffseg::levelset
