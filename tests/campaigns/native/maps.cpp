// Edge maps, fast marching, level sets and outlines.
#include <algorithm>
#include <cmath>
#include <limits>

#include "baselines/levelset/levelset.hpp"
#include "baselines/levelset/outline.hpp"
#include "baselines/marching/march.hpp"
#include "edges/canny.hpp"
#include "edges/gradient.hpp"
#include "edges/noise.hpp"
#include "targets.hpp"

namespace fuzz {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
// Slownesses are infinite or lie between these.
constexpr double kLeast = 1e-100, kMost = 1e100;
constexpr int kLongestGrid = 32767;

std::uint16_t draw_threshold(Random& random) {
    return random.pick<std::uint16_t>({0, 1, 2, 64, 800, 5773, 65535, static_cast<std::uint16_t>(random.below(65536))});
}

// Area inside outlines half-way between pixels: a pixel each, and an eighth less for every corner that is cut, more for
// every corner that is filled. Pixels that touch at a corner are apart.
double enclosed(const std::vector<std::uint8_t>& mask, Size size) {
    const auto at = [&](int x, int y) {
        if (x < 0 || y < 0 || x >= size.width || y >= size.height) return 0;
        return mask[static_cast<std::size_t>(y) * static_cast<std::size_t>(size.width) + static_cast<std::size_t>(x)] !=
                       0
                   ? 1
                   : 0;
    };
    double area = 0.0;
    for (int y = -1; y < size.height; ++y) {
        for (int x = -1; x < size.width; ++x) {  // the four pixels round a corner
            const int set = at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1);
            const bool diagonal = set == 2 && at(x, y) == at(x + 1, y + 1);
            area += at(x, y) + 0.125 * (set == 3 ? 1 : set == 1 ? -1 : diagonal ? -2 : 0);
        }
    }
    return area;
}

double draw_slowness(Random& random) {
    return random.pick(
        {kLeast, kMost, kInfinite, 1.0, 1.0, 1e-3, 1e3, random.scale(1e-6, 1e6), random.scale(kLeast, kMost)});
}

}  // namespace

// The binding's limits: 1 to 65535 pixels a side, 1 to 4 channels, sigma above 0 to 32; thresholds of 16 bits; any
// gradient and any ridges.
void edges(Random& random) {
    const Size size = draw_size(random, 1, 65535);
    const int channels = random.pick({1, 1, 3, 2, 4});
    const std::vector<std::uint8_t> image = draw_bytes(random, size.count() * static_cast<std::size_t>(channels));
    const ffseg::Picture view{image.data(), size.height, size.width, channels};
    const double sigma =
        random.pick({0.01, 0.5, 1.5, 1.5, 4.0, 20.0, ffseg::edges::kMaxSigma, random.scale(1e-3, 32.0)});
    std::vector<std::uint16_t> gradient(size.count(), 65535);
    std::vector<std::uint8_t> out(size.count(), 7);
    ffseg::edges::gradient_and_ridges(view, ffseg::edges::gaussian(sigma), gradient.data(), out.data());
    expect(*std::max_element(gradient.begin(), gradient.end()) <= 5773, "a gradient above the largest there is");
    expect(std::all_of(out.begin(), out.end(), [](std::uint8_t v) { return v <= 1; }), "a ridge that is not 0 or 1");
    if (random.once_in(4)) out = draw_bytes(random, size.count());
    if (random.once_in(3)) gradient = draw_gradient(random, size);
    const std::vector<std::uint8_t> domain = draw_domain(random, size);
    const ffseg::edges::NoiseMap noise =
        ffseg::edges::noise_map(gradient.data(), or_null(domain), size.height, size.width);
    ffseg::edges::ThresholdMap thresholds;
    thresholds.columns = (size.width + ffseg::edges::NoiseMap::kBlock - 1) / ffseg::edges::NoiseMap::kBlock;
    const int rows = (size.height + ffseg::edges::NoiseMap::kBlock - 1) / ffseg::edges::NoiseMap::kBlock;
    const std::size_t blocks = static_cast<std::size_t>(rows) * static_cast<std::size_t>(thresholds.columns);
    expect(noise.blocks.size() == blocks, "the noise has not one value a block");
    const bool even = random.once_in(2);
    const std::uint16_t low = draw_threshold(random), high = draw_threshold(random);
    for (std::size_t i = 0; i < blocks; ++i) {
        thresholds.low.push_back(even ? low : draw_threshold(random));
        thresholds.high.push_back(even ? high : draw_threshold(random));
    }
    ffseg::edges::link_edges(gradient.data(), size.height, size.width, thresholds, out.data());
    expect(std::all_of(out.begin(), out.end(), [](std::uint8_t v) { return v == 0 || v == 255; }), "an edge pixel");
}

// The binding's limits: 1 to 32767 pixels a side; slownesses of 1e-100 to 1e100 or infinite, infinite on the ring.
void march(Random& random) {
    const Size size = draw_size(random, 1, kLongestGrid);
    const ffseg::marching::Grid grid{size.height, size.width};
    const std::vector<std::uint8_t> domain = draw_domain(random, size), inside = draw_marks(random, size);
    std::vector<double> values(grid.size(), kInfinite);
    const int kind = random.below(3);
    const double one = draw_slowness(random);
    for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x) {
            double& value = values[static_cast<std::size_t>(grid.node(x, y))];
            value = kind == 0 ? one : kind == 1 ? random.between(0.1, 10) : draw_slowness(random);
        }
    }
    const ffseg::marching::SlownessPlane slowness{values.data()};
    ffseg::marching::March front(grid, or_null(domain));
    front.accept(inside.data());
    ffseg::marching::ArrivalQueue queue(ffseg::marching::bucket_width(grid, slowness), front.time.data(),
                                        grid.stride());
    front.begin(slowness, queue);
    front.run(slowness, queue);
    expect(front.order.size() <= size.count(), "a node was accepted twice");
    double last = 0.0;
    for (const std::int32_t node : front.order) {
        const double time = front.time[static_cast<std::size_t>(node)];
        expect(time >= last, "the front went back in time");
        last = time;
    }
}

// The binding's limits: as of a march; 1 <= stop <= 65536, 0 <= reach <= 64, min_area >= 0; slownesses below `stop` lie
// between 1e-100 and 1e100, those from there on are infinite.
void level_set(Random& random) {
    const Size size = draw_size(random, 1, kLongestGrid);
    const ffseg::marching::Grid grid{size.height, size.width};
    const std::vector<std::uint8_t> domain = draw_domain(random, size), inside = draw_marks(random, size);
    const std::vector<std::uint16_t> gradient = draw_gradient(random, size);
    const int stop = random.pick({1, 2, 64, 800, 65535, 65536, random.among(1, 65536)});
    static thread_local std::vector<double> table(65536);
    const double steep = random.pick({0.0, 1e-3, 1.0}), first = random.pick({1.0, kLeast, 1e50});
    for (int level = 0; level < 65536; ++level) {
        table[static_cast<std::size_t>(level)] = level < stop ? first * (1.0 + steep * level) : kInfinite;
    }
    const double min_area = random.pick({0.0, 0.0, 4.0, 1e9, kInfinite});
    const ffseg::levelset::LevelSetInput input{grid,
                                               gradient.data(),
                                               table.data(),
                                               inside.data(),
                                               or_null(domain),
                                               stop,
                                               random.pick({0, 1, 4, 64}),
                                               random.once_in(3),
                                               min_area};
    const ffseg::levelset::LevelSetResult result = ffseg::levelset::level_set(input);
    expect(result.points.size() == result.offsets.back(), "the offsets end elsewhere than the points");
    for (const ffseg::Vec2 p : result.points) {
        expect(p.x >= -1 && p.x <= size.width && p.y >= -1 && p.y <= size.height, "an outline leaves the image");
    }
}

// The binding's limits: 1 to 32767 pixels a side, any mask.
void outlines(Random& random) {
    const Size size = draw_size(random, 1, kLongestGrid);
    const std::vector<std::uint8_t> mask = draw_marks(random, size);
    double twice = 0.0;
    for (const std::vector<ffseg::Vec2>& outline :
         ffseg::levelset::Region({size.height, size.width}, mask.data()).outlines(nullptr)) {
        expect(outline.size() >= 4, "an outline of less than four points");
        for (std::size_t i = 2; i < outline.size(); ++i) {
            twice += ffseg::cross(outline[i - 1] - outline[0], outline[i] - outline[0]);
        }
    }
    expect(twice == 2.0 * enclosed(mask, size), "the outlines enclose another area");
}

}  // namespace fuzz
