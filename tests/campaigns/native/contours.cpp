// Free-form contours and their masks.
#include <algorithm>
#include <cmath>
#include <limits>

#include "freeform/evolution.hpp"
#include "raster/raster.hpp"
#include "targets.hpp"

namespace fuzz {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kLargest = std::numeric_limits<double>::max();
constexpr int kLongestMap = 65535;
// Settling takes crossings out of a contour in a time that grows with the square of its length: longer strips are left
// out, or they would be all that is fuzzed.
constexpr int kLongestSettled = 2048;

// The binding's limits: degree 1..6, 1 <= split_threshold <= 1e6, 0 < balloon <= 1e3, max_iterations >= 0,
// 0 <= clearance <= 1e4, 0 <= settle <= 16, ridge_low >= 0, 0 <= weight <= 1e3, 0 <= window <= 1e5.
ffseg::freeform::EvolutionOptions draw_options(Random& random) {
    ffseg::freeform::EvolutionOptions options;
    options.degree = random.among(1, 6);
    options.split_threshold = random.pick({4.0, 6.0, 14.0, 14.0, 24.0, 1e3, 1e6, random.between(3, 40)});
    if (random.once_in(20)) options.split_threshold = random.pick({1.0, 2.0, 2.0, 2.0});  // thousands of patches
    options.balloon = random.pick({5e-324, 1e-9, 0.3, 1.0, 2.0, 2.0, 4.0, 16.0, 1e3, random.between(0.1, 5)});
    options.refine = !random.once_in(6);
    options.topology = !random.once_in(8);
    options.max_iterations = random.pick({0, 1, 7, 2000, 2000, 2000, std::numeric_limits<int>::max()});
    options.clearance = random.pick({0.0, 0.0, 0.0, 0.0, 5e-324, 1.0, 3.0, 8.0, 40.0, 1e4});
    options.settle = random.pick({0.0, 5e-324, 1.0, 4.0, 4.0, 16.0});
    options.ridge_low = random.pick({0.0, 1.0, 32.0, 1e9, kInfinite});
    options.weight = random.pick({0.0, 0.0, 0.0, 5e-324, 0.3, 1.0, 1e3});
    options.window = random.pick({0.0, 0.0, 5e-324, 16.0, 64.0, 1e5});
    return options;
}

// Closed contours of two patches or more, finite.
ffseg::freeform::ContourSet draw_starts(Random& random, Size size, int degree) {
    ffseg::freeform::ContourSet starts;
    for (int c = random.pick({1, 1, 1, 2, 3}); c > 0; --c) {
        const int patches = random.once_in(200) ? random.among(2, 300) : random.among(2, 12);
        const std::vector<ffseg::Vec2> points = draw_points(random, size, patches * degree, kLargest);
        starts.points.insert(starts.points.end(), points.begin(), points.end());
        starts.offsets.push_back(starts.points.size());
    }
    return starts;
}

void check_mask(const std::vector<std::uint8_t>& mask) {
    expect(std::all_of(mask.begin(), mask.end(), [](std::uint8_t pixel) { return pixel <= 1; }), "a mask pixel");
}

void draw_mask(const ffseg::freeform::ContourSet& set, int degree, Size size) {
    const ffseg::raster::PixelGrid grid{size.width - 1.0, size.height - 1.0, 0.01};
    std::vector<ffseg::raster::Edge> pieces;
    for (std::size_t c = 0; c + 1 < set.offsets.size(); ++c) {
        ffseg::raster::append_contour(set.points.data() + set.offsets[c], set.offsets[c + 1] - set.offsets[c], degree,
                                      grid, pieces);
    }
    std::vector<std::uint8_t> mask(size.count(), 7);
    ffseg::raster::fill_mask(pieces, {mask.data(), size.height, size.width});
    check_mask(mask);
}

}  // namespace

void evolve(Random& random) {
    const Size size = draw_size(random, 1, kLongestMap);
    const ffseg::freeform::EvolutionOptions options = draw_options(random);
    const int channels = options.weight > 0 ? random.among(1, 3) : 0;
    std::vector<std::uint8_t> image(size.count() * static_cast<std::size_t>(channels));  // as long as the evolution
    for (std::uint8_t& level : image) level = static_cast<std::uint8_t>(random.below(256));
    std::unique_ptr<ffseg::freeform::Evolution> evolution;
    {
        const std::vector<std::uint8_t> edge_map = draw_marks(random, size), domain = draw_domain(random, size);
        const ffseg::freeform::ContourSet starts = draw_starts(random, size, options.degree);
        evolution = ffseg::freeform::make_evolution(starts, edge_map.data(), or_null(domain), size.height, size.width,
                                                    options, {or_null(image), size.height, size.width, channels});
    }  // nothing else of the input is read after this
    const int most = size.count() > 4000 ? 4 : 40;
    for (int rounds = random.pick({0, 1, 2, 3, 4}); rounds > 0; --rounds) {
        if (!evolution->advance(static_cast<int>(random.scale(1, most)))) break;
    }
    const std::vector<std::uint16_t> gradient = draw_gradient(random, size);
    const bool settled = std::max(size.height, size.width) <= kLongestSettled;
    const int settles = settled ? random.pick({0, 1, 1, 1}) : 0;
    for (int i = settles; i > 0; --i) evolution->settle({gradient.data(), size.height, size.width});
    if (random.once_in(50)) evolution->advance(random.among(-1, 2));
    if (settled && random.once_in(50)) evolution->settle({gradient.data(), size.height, size.width});
    const ffseg::freeform::ContourSet found = evolution->contours();
    const auto finite = [](ffseg::Vec2 p) { return std::isfinite(p.x) && std::isfinite(p.y); };
    expect(std::all_of(found.points.begin(), found.points.end(), finite), "a control point is not finite");
    expect(found.points.size() == found.offsets.back(), "the offsets end elsewhere than the points");
    expect(found.points.size() % static_cast<std::size_t>(options.degree) == 0, "a patch is not whole");
    expect(evolution->counts().iterations <= options.max_iterations, "more iterations than allowed");
    draw_mask(found, options.degree, size);
}

// The binding's limits: up to 65535 pixels a side, empty ones too; |coordinates| <= 1e100; one patch or more a contour;
// tolerance >= 1e-6. Fine tolerances are kept to small maps: their cost is what was asked for.
void rasterize(Random& random) {
    Size size = draw_size(random, 1, kLongestMap);
    if (random.once_in(60)) size.height = 0;
    if (random.once_in(60)) size.width = 0;
    const bool small = size.count() < 400;
    const double tolerance = random.pick({small ? 1e-6 : 1e-3, 1e-3, 0.01, 0.1, 0.5, 1e3, kInfinite});
    const ffseg::raster::PixelGrid grid{size.width - 1.0, size.height - 1.0, tolerance};
    std::vector<ffseg::raster::Edge> pieces;
    for (int c = random.below(4); c > 0; --c) {
        const int degree = random.among(1, 6);
        const int patches = random.once_in(300) ? random.among(1, 200) : random.among(1, 8);
        const std::vector<ffseg::Vec2> points = draw_points(random, size, patches * degree, 1e100);
        ffseg::raster::append_contour(points.data(), points.size(), degree, grid, pieces);
    }
    for (const ffseg::raster::Edge& piece : pieces) expect(piece.low.y < piece.high.y, "an edge does not rise");
    std::vector<std::uint8_t> mask(size.count(), 7);
    ffseg::raster::fill_mask(pieces, {mask.data(), size.height, size.width});
    check_mask(mask);
}

}  // namespace fuzz
