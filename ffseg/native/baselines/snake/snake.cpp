#include "baselines/snake/snake.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace ffseg::snake {
namespace {

// Edge zones reach this far (px) round an edge pixel: the flank of an edge blurred by one to two pixels, and more than
// the longest step between two looks at the zone.
constexpr int kZoneReach = 2;
// Longest move by the edge force in one iteration: on the outer flank the force overshoots the ridge.
constexpr double kMaxAttraction = 1.0;
// No point moves farther (px) in one iteration, as stiff internal forces on far points would have it: every pixel that
// a stretch crosses is marked.
constexpr double kMaxMove = 64.0;
// Steps (px) in which a way is looked along: finer than the pixels that are looked at.
constexpr double kFine = 0.5;
// The balloon keeps this far (px) from pixels the snake has swept; its own last pixel reaches 0.7 px ahead of it.
constexpr double kContact = 1.5;
// The snake has converged when for kQuiet iterations all but this share of its points moved less than the tolerance.
constexpr double kRestless = 0.02;
constexpr int kQuiet = 5;
constexpr std::size_t kMinPoints = 5;
constexpr std::size_t kMaxPoints = 1u << 20;

template <class Mark>
void each_pixel_near(Vec2 at, double radius, int height, int width, Mark mark) {
    const int x0 = static_cast<int>(std::max(0.0, std::ceil(at.x - radius)));
    const int y0 = static_cast<int>(std::max(0.0, std::ceil(at.y - radius)));
    for (int y = y0; y < height && y <= at.y + radius; ++y) {
        for (int x = x0; x < width && x <= at.x + radius; ++x) {
            const Vec2 p{static_cast<double>(x), static_cast<double>(y)};
            if (norm2(p - at) <= radius * radius) mark(static_cast<std::size_t>(y) * width + x);
        }
    }
}

}  // namespace

Vec2 SnakeField::clamp(Vec2 p) const {
    constexpr double kInside = 0.5 - 1e-6;
    return {std::min(std::max(p.x, -kInside), width - 1 + kInside),
            std::min(std::max(p.y, -kInside), height - 1 + kInside)};
}

std::size_t SnakeField::pixel(Vec2 p) const {
    return static_cast<std::size_t>(p.y + 0.5) * static_cast<std::size_t>(width) + static_cast<std::size_t>(p.x + 0.5);
}

std::vector<std::uint8_t> snake_zones(const std::uint8_t* edges, int height, int width,
                                      const std::vector<AltitudePoint>& points) {
    std::vector<std::uint8_t> zone(static_cast<std::size_t>(height) * static_cast<std::size_t>(width));
    for (int y = 0; y < height; ++y) {
        const std::uint8_t* row = edges + static_cast<std::ptrdiff_t>(y) * width;
        for (const std::uint8_t* at = row;
             (at = static_cast<const std::uint8_t*>(std::memchr(at, 255, row + width - at))); ++at) {
            const int x = static_cast<int>(at - row);
            const int x0 = std::max(x - kZoneReach, 0), x1 = std::min(x + kZoneReach, width - 1);
            const int y0 = std::max(y - kZoneReach, 0), y1 = std::min(y + kZoneReach, height - 1);
            for (int v = y0; v <= y1; ++v) {
                std::memset(zone.data() + static_cast<std::ptrdiff_t>(v) * width + x0, kEdge, x1 - x0 + 1);
            }
        }
    }
    for (const bool low : {false, true}) {  // where zones of both kinds overlap, the obstacle wins
        for (const AltitudePoint& m : points) {
            if (m.low != low) continue;
            each_pixel_near(m.at, m.radius, height, width, [&](std::size_t pixel) {
                if (zone[pixel] == kEdge) zone[pixel] = low ? kHomogeneous : kStrongEdge;
            });
        }
    }
    return zone;
}

Snake::Snake(SnakeField field, std::vector<Vec2> points, const SnakeOptions& options)
    : field_(std::move(field)),
      options_(options),
      system_(options.tension, options.rigidity),
      points_(std::move(points)) {
    for (Vec2& p : points_) p = field_.clamp(p);
}

bool Snake::advance(int most) {
    for (int i = 0; i < most && stop_ == Stop::kRunning; ++i) step();
    return stop_ == Stop::kRunning;
}

void Snake::step() {
    if (points_.size() < kMinPoints) {
        stop_ = Stop::kVanished;
        return;
    }
    if (points_.size() >= kMaxPoints) {
        stop_ = Stop::kMaxPoints;
        return;
    }
    if (counts_.iterations == options_.max_iterations) {
        stop_ = Stop::kMaxIterations;
        return;
    }
    if (options_.budget > 0 && counts_.moved > options_.budget) {
        stop_ = Stop::kBudget;
        return;
    }
    ++counts_.iterations;
    const std::size_t n = points_.size();
    counts_.moved += n;
    normals_.resize(n);
    for (std::size_t i = 0; i < n; ++i) normals_[i] = normal(i);
    next_.resize(n);
    for (std::size_t i = 0; i < n; ++i) next_[i] = points_[i] + force(i);
    system_.solve(next_);
    std::size_t moved = 0;
    for (std::size_t i = 0; i < n; ++i) {
        next_[i] = move(points_[i], next_[i]);
        moved += std::abs(dot(next_[i] - points_[i], normals_[i])) > options_.tolerance;
    }
    for (std::size_t i = 0; i < n; ++i) {
        const std::size_t j = i + 1 < n ? i + 1 : 0;
        sweep(points_[i], points_[j], next_[i], next_[j]);
    }
    points_.swap(next_);
    const bool changed = options_.refine && refine();
    quiet_ = !changed && static_cast<double>(moved) <= kRestless * static_cast<double>(n) ? quiet_ + 1 : 0;
    if (quiet_ == kQuiet) stop_ = Stop::kConverged;
}

// Outer unit normal: to the left of the way along a contour of positive area.
Vec2 Snake::normal(std::size_t i) const {
    const std::size_t n = points_.size();
    const Vec2 along = points_[i + 1 < n ? i + 1 : 0] - points_[i > 0 ? i - 1 : n - 1];
    const double size = norm(along);
    return size > 0 ? Vec2{along.y / size, -along.x / size} : Vec2{};
}

Vec2 Snake::force(std::size_t i) const {
    const Vec2 n = normals_[i];
    const std::uint8_t zone = field_.zone[field_.pixel(points_[i])];
    if (zone == kHomogeneous || zone == kSwept) {
        const Vec2 way = options_.balloon < 0 ? -1.0 * n : n;
        return free_way(points_[i], way) * way;
    }
    double level = 0.0;
    const Vec2 slope = gradient(points_[i], level);
    if (!(level > 0)) return {};
    const double gain = zone == kStrongEdge ? 2.0 * options_.attraction : options_.attraction;
    return std::clamp(gain * dot(slope, n) / level, -kMaxAttraction, kMaxAttraction) * n;
}

// How far the balloon may push: to the first edge zone on its way, and not near to where the snake has been.
double Snake::free_way(Vec2 from, Vec2 way) const {
    const double wanted = std::abs(options_.balloon);
    for (double reach = kFine; reach < wanted + kContact; reach += kFine) {
        const std::uint8_t zone = field_.zone[field_.pixel(field_.clamp(from + reach * way))];
        if (zone == kSwept && reach >= kContact) return std::min(wanted, reach - kContact);
        if (zone != kSwept && zone != kHomogeneous && reach < wanted) return reach;
    }
    return wanted;
}

// Slope of the stored gradient magnitude at p and its value, both bilinear between the pixels.
Vec2 Snake::gradient(Vec2 p, double& level) const {
    const double x = std::clamp(p.x, 0.0, field_.width - 1.0), y = std::clamp(p.y, 0.0, field_.height - 1.0);
    const int column = static_cast<int>(x), row = static_cast<int>(y);
    double at[4][4];  // the pixels round p, border pixels repeated
    for (int v = 0; v < 4; ++v) {
        const int r = std::clamp(row + v - 1, 0, field_.height - 1);
        const std::uint16_t* line = field_.gradient + static_cast<std::ptrdiff_t>(r) * field_.width;
        for (int u = 0; u < 4; ++u) at[v][u] = line[std::clamp(column + u - 1, 0, field_.width - 1)];
    }
    const double fx = x - column, fy = y - row;
    Vec2 slope;
    level = 0.0;
    for (int v = 1; v < 3; ++v) {
        for (int u = 1; u < 3; ++u) {
            const double weight = (u == 2 ? fx : 1 - fx) * (v == 2 ? fy : 1 - fy);
            level += weight * at[v][u];
            slope += weight * Vec2{0.5 * (at[v][u + 1] - at[v][u - 1]), 0.5 * (at[v + 1][u] - at[v - 1][u])};
        }
    }
    return slope;
}

// The last place inside the domain on the straight way, at most kMaxMove away.
Vec2 Snake::move(Vec2 from, Vec2 to) const {
    const double wanted = norm(to - from);
    to = field_.clamp(wanted > kMaxMove ? from + (kMaxMove / wanted) * (to - from) : to);
    if (field_.domain == nullptr) return to;
    const double length = norm(to - from);
    Vec2 last = from;
    for (double done = kFine; done < length; done += kFine) {
        const Vec2 p = from + (done / length) * (to - from);
        if (field_.barred(p)) return last;
        last = p;
    }
    return field_.barred(to) ? last : to;
}

// Marks the homogeneous pixels a stretch ab has moved over on its way to cd.
void Snake::sweep(Vec2 a, Vec2 b, Vec2 c, Vec2 d) {
    const double moved = std::max(norm2(c - a), norm2(d - b));
    if (moved < options_.tolerance * options_.tolerance) return;
    const int ahead = 1 + static_cast<int>(std::sqrt(moved));
    const int along = 1 + static_cast<int>(std::sqrt(std::max(norm2(b - a), norm2(d - c))));
    const Vec2 near_step = (1.0 / along) * (b - a), far_step = (1.0 / along) * (d - c);
    const double share = 1.0 / ahead;
    for (int i = 0; i < along; ++i) {
        const Vec2 from = a + i * near_step, step = share * (c + i * far_step - from);
        for (int k = 1; k <= ahead; ++k) {
            std::uint8_t& zone = field_.zone[field_.pixel(from + k * step)];
            if (zone == kHomogeneous) zone = kSwept;
        }
    }
}

// A point in the middle of long stretches; points that crowd their predecessor go.
bool Snake::refine() {
    const double longest = options_.spacing * options_.spacing, shortest = longest / 9.0;
    const std::size_t n = points_.size();
    bool fits = true;
    for (std::size_t i = 0; i < n && fits; ++i) {
        const double length = norm2(points_[i + 1 < n ? i + 1 : 0] - points_[i]);
        fits = length <= longest && length >= shortest;
    }
    if (fits) return false;
    const int before = counts_.insertions + counts_.removals;
    next_.clear();
    for (std::size_t i = 0; i < n; ++i) {
        const Vec2 a = points_[i], b = points_[i + 1 < n ? i + 1 : 0];
        if (!next_.empty() && norm2(a - next_.back()) < shortest) {
            ++counts_.removals;
            continue;
        }
        next_.push_back(a);
        if (norm2(b - a) > longest) {
            next_.push_back(0.5 * (a + b));
            ++counts_.insertions;
        }
    }
    points_.swap(next_);
    return counts_.insertions + counts_.removals > before;
}

}  // namespace ffseg::snake
