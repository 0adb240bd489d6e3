// Snakes, cyclic systems, distances, patches of image pairs and the text of paths.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "baselines/measures/nearest.hpp"
#include "baselines/snake/cyclic.hpp"
#include "baselines/snake/snake.hpp"
#include "pairs/interest.hpp"
#include "pairs/patches.hpp"
#include "targets.hpp"
#include "text/path_text.hpp"

namespace fuzz {
namespace {

using ffseg::Vec2;

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kFar = 1e6;  // of a snake's points
constexpr int kLongestGrid = 32767, kLongestPair = 65535;

bool finite(Vec2 p) { return std::isfinite(p.x) && std::isfinite(p.y); }

// The binding's limits: 0..1e3 for weights and attraction, |balloon| <= 64, 0.5 <= spacing <= 1e6, 0 <= tolerance <=
// 1e6.
ffseg::snake::SnakeOptions draw_options(Random& random) {
    ffseg::snake::SnakeOptions options;
    const auto weight = [&] { return random.pick({0.0, 5e-324, 0.02, 0.02, 1.0, 1e3}); };
    options.tension = weight();
    options.rigidity = weight();
    options.balloon = random.pick({-64.0, -2.0, 0.0, 5e-324, 0.3, 2.0, 2.0, 64.0});
    options.attraction = random.pick({0.0, 2.5, 2.5, 1e3});
    options.spacing = random.pick({0.5, 2.0, 6.0, 6.0, 1e6});
    options.tolerance = random.pick({0.0, 0.05, 0.05, 1e6});
    options.refine = !random.once_in(5);
    options.max_iterations = random.pick({0, 3, 2000, std::numeric_limits<int>::max()});
    return options;
}

double any_number(Random& random) {
    return random.pick({kNan, kInfinite, -kInfinite, hostile(random, kInfinite), 0.0});
}

// Anything, mostly close to the identity, now and then at the limit of what rounding keeps apart.
ffseg::pairs::Warp draw_warp(Random& random) {
    const double size = random.pick({1.0, 1.0, 1.0, 0.0, 1e-12, 1e-17, 30.0}), skew = random.pick({0.0, 0.1, 1.0});
    ffseg::pairs::Warp warp{size, skew * random.between(-1, 1), skew * random.between(-1, 1),
                            random.pick({size, -size, 1.0})};
    for (double* part : {&warp.xx, &warp.xy, &warp.yx, &warp.yy}) {
        if (random.once_in(60)) *part = any_number(random);
    }
    return warp;
}

// Anything: the binding does not look at places. Many lie at the very last one that fits.
Vec2 draw_place(Random& random, Size size, int radius) {
    Vec2 place{random.between(-1, size.width), random.between(-1, size.height)};
    if (random.once_in(3)) place = {std::round(place.x), std::round(place.y)};
    if (random.once_in(4)) {
        const double left = size.width - 1.0 - random.pick({0, radius, radius + 1});
        place.x = random.once_in(2) ? left - random.scale(1e-13, 1e-9) : std::nextafter(left, 0.0);
    }
    if (random.once_in(4)) place.y = std::nextafter(size.height - 1.0 - random.pick({0, radius, radius + 1}), 0.0);
    if (random.once_in(60)) place.x = any_number(random);
    if (random.once_in(60)) place.y = any_number(random);
    return place;
}

// Images of 2 to 65535 pixels a side and a radius of 1 to 32, which mostly fits.
struct Pair {
    Size current_size, previous_size;
    std::vector<std::uint8_t> current, previous;
    int radius;

    explicit Pair(Random& random)
        : current_size(draw_size(random, 2, kLongestPair)),
          previous_size(random.once_in(2) ? current_size : draw_size(random, 2, kLongestPair)),
          current(draw_bytes(random, current_size.count())),
          previous(previous_size.count() == current.size() && random.once_in(2)
                       ? current
                       : draw_bytes(random, previous_size.count())),
          radius(random.pick({1, 1, 2, 4, 32})) {}
    ffseg::pairs::ImagePair view() const {
        return {{current.data(), current_size.height, current_size.width},
                {previous.data(), previous_size.height, previous_size.width}};
    }
};

}  // namespace

// The binding's limits: 1 to 32767 pixels a side, points up to 1e6, altitude points up to 1e6 with radii of 0 to 1e4.
void snake(Random& random) {
    const Size size = draw_size(random, 1, kLongestGrid);
    const std::vector<std::uint8_t> edges = draw_marks(random, size), domain = draw_domain(random, size);
    const std::vector<std::uint16_t> gradient = draw_gradient(random, size);
    std::vector<ffseg::snake::AltitudePoint> known;
    for (int i = random.pick({0, 0, 0, 1, 4}); i > 0; --i) {
        const std::vector<Vec2> at = draw_points(random, size, 1, kFar);
        known.push_back({at[0], random.pick({0.0, 0.5, 3.0, 20.0, 1e4}), random.once_in(2)});
    }
    ffseg::snake::SnakeField field{gradient.data(), size.height, size.width, or_null(domain),
                                   ffseg::snake::snake_zones(edges.data(), size.height, size.width, known)};
    ffseg::snake::Snake made(std::move(field), draw_points(random, size, random.below(40), kFar), draw_options(random));
    for (int rounds = random.below(3); rounds > 0; --rounds) {
        // Points double at most with every iteration, and steps cost as much as the pixels they cross.
        if (made.points().size() > 4000 ||
            !made.advance(size.count() > 4000 ? 2 : static_cast<int>(random.scale(1, 30))))
            break;
    }
    expect(std::all_of(made.points().begin(), made.points().end(), finite), "a point of a snake is not finite");
}

// The binding's limits: 5 rows or more up to 1e6, weights of 0 to 1000.
void cyclic(Random& random) {
    std::vector<Vec2> rows = draw_points(random, {40, 40}, random.pick({5, 6, 7, random.among(5, 400)}), kFar);
    const auto weight = [&] { return random.pick({0.0, 5e-324, 0.02, 1.0, 1e3, random.scale(1e-6, 1e3)}); };
    const double tension = weight(), rigidity = weight();
    ffseg::snake::CyclicSystem(tension, rigidity).solve(rows);
    // The smallest eigenvalue of the system is one.
    const auto bounded = [](Vec2 p) { return std::abs(p.x) <= 4e7 && std::abs(p.y) <= 4e7; };
    expect(std::all_of(rows.begin(), rows.end(), bounded), "a solution is larger than the right-hand side allows");
}

// The binding's limits: coordinates up to 1e9; either set may be empty. Far points cost a large table of cells.
void nearest(Random& random) {
    const double limit = random.once_in(300) ? 1e9 : random.pick({10.0, 300.0, 2000.0});
    const Size size = draw_size(random, 1, 300);
    const std::vector<Vec2> points = draw_points(random, size, random.below(30), limit);
    const std::vector<Vec2> others = draw_points(random, size, random.below(60), limit);
    const std::vector<double> found = ffseg::measures::nearest_distances(points, others);
    for (std::size_t i = 0; i < points.size(); ++i) {
        double least = kInfinite;
        for (const Vec2 p : others) least = std::min(least, ffseg::norm2(p - points[i]));
        expect(found[i] == std::sqrt(least), "a distance is not that of the nearest point");
    }
}

// The binding's limits: images of 2 to 65535 pixels a side, radius 1 to 32; places and warps are anything.
void scores(Random& random) {
    const Pair pair(random);
    const int count = random.below(6);
    ffseg::pairs::Candidates tried;
    for (int k = 0; k < count; ++k) {
        tried.places.push_back(draw_place(random, pair.previous_size, pair.radius));
        tried.warps.push_back(draw_warp(random));
    }
    const double hopeless = random.pick({-2.0, 0.0, 0.5, 2.0, -kInfinite, kInfinite});
    std::vector<double> found(tried.places.size());
    const Vec2 center = draw_place(random, pair.current_size, pair.radius);
    ffseg::pairs::patch_scores(pair.view(), center, tried, pair.radius, hopeless, found.data());
    for (const double score : found) expect(!(std::abs(score) > 1.001), "a correlation beyond one");
}

// The same, and 0 to 1000 steps.
void alignment(Random& random) {
    const Pair pair(random);
    const Vec2 center = draw_place(random, pair.current_size, pair.radius);
    const Vec2 start = random.once_in(2) ? center : draw_place(random, pair.previous_size, pair.radius);
    const int steps = random.pick({0, 1, 5, 20, pair.radius < 4 ? 1000 : 50});
    const ffseg::pairs::Alignment found =
        ffseg::pairs::align_patch(pair.view(), center, start, draw_warp(random), pair.radius, steps);
    expect(!(std::abs(found.score) > 1.001), "a correlation beyond one");
}

// The binding's limits: images as above, a window inside the image that is not empty, grown by 0 to 32 pixels.
void interest(Random& random) {
    const Size size = draw_size(random, 2, kLongestPair);
    const std::vector<std::uint8_t> image = draw_bytes(random, size.count());
    ffseg::pairs::ComponentWindow region;
    region.x = random.below(size.width);
    region.y = random.below(size.height);
    region.width = random.among(1, size.width - region.x);
    region.height = random.among(1, size.height - region.y);
    region.mask = draw_marks(random, {region.height, region.width});
    const ffseg::Picture view{image.data(), size.height, size.width, 1};
    const ffseg::pairs::ComponentWindow wide =
        ffseg::pairs::grown(region, random.pick({0, 1, 3, 32}), size.width, size.height);
    const int most = random.pick({0, 1, 8, 65535});
    for (const auto find : {ffseg::pairs::harris_points, ffseg::pairs::outline_points}) {
        const std::vector<Vec2> found = find(view, wide, most);
        expect(static_cast<int>(found.size()) <= most, "more points than asked for");
        const auto inside = [&](Vec2 p) {
            return p.x > -2 && p.y > -2 && p.x < size.width + 1 && p.y < size.height + 1;
        };
        expect(std::all_of(found.begin(), found.end(), inside), "a point outside the image");
    }
}

// The binding's limits: degree 1 to 3, one patch or more, coordinates up to 1e11.
void path_text(Random& random) {
    const int degree = random.among(1, 3);
    const int patches = random.once_in(50) ? random.among(1, 500) : random.among(1, 12);
    const std::vector<Vec2> points = draw_points(random, {600, 800}, patches * degree, ffseg::text::kMaxWritten);
    const std::string text = ffseg::text::path_text(points, degree);
    const auto written = [](char c) { return std::string(" ,-.0123456789MLQCZ").find(c) != std::string::npos; };
    expect(std::all_of(text.begin(), text.end(), written), "a character that is none of a path");
}

}  // namespace fuzz
