#include "pairs/patches.hpp"

#include <cmath>
#include <limits>

namespace ffseg {

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
// Sum of squared deviations below which a patch is flat: under half a grey level in the mean of a 9x9 patch.
constexpr double kFlat = 4.0;
// Pixels; a Gauss-Newton step shorter than this changes nothing that the noise does not.
constexpr double kStill = 0.01;
// Pixels; a longer step means that the linearisation does not hold.
constexpr double kLeap = 2.0;
// Ratio of the two curvatures of the fit below which a patch is an edge.
constexpr double kWeak = 0.05;

double bilinear(const PlaneView& image, double x, double y) {
    const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
    const double u = x - x0, v = y - y0;
    const std::uint8_t* row = image.data + static_cast<std::size_t>(y0) * image.width + x0;
    const std::uint8_t* next = row + image.width;
    return (1 - v) * ((1 - u) * row[0] + u * row[1]) + v * ((1 - u) * next[0] + u * next[1]);
}

// The whole patch, and a ring of one pixel for its derivatives, must lie where four neighbours exist.
bool fits(const PlaneView& image, Vec2 center, const Warp& warp, int radius) {
    const double reach = radius + 1;
    const double across = reach * (std::abs(warp.xx) + std::abs(warp.xy));
    const double down = reach * (std::abs(warp.yx) + std::abs(warp.yy));
    return center.x - across >= 0 && center.y - down >= 0 && center.x + across < image.width - 1 &&
           center.y + down < image.height - 1;  // false for NaN too
}

}  // namespace

Patch::Patch(int radius) : radius_(radius), values_(static_cast<std::size_t>((2 * radius + 1) * (2 * radius + 1))) {}

bool Patch::sample(const PlaneView& image, Vec2 center, const Warp& warp) {
    if (!fits(image, center, warp, radius_)) return false;
    double sum = 0.0, squares = 0.0;
    std::size_t k = 0;
    for (int dy = -radius_; dy <= radius_; ++dy) {
        double x = center.x + warp.xy * dy - warp.xx * radius_, y = center.y + warp.yy * dy - warp.yx * radius_;
        for (int dx = -radius_; dx <= radius_; ++dx, x += warp.xx, y += warp.yx) {
            const double value = bilinear(image, x, y);
            values_[k++] = value;
            sum += value;
            squares += value * value;
        }
    }
    mean_ = sum / static_cast<double>(k);
    const double deviation = squares - sum * mean_;
    spread_ = deviation > kFlat ? std::sqrt(deviation) : 0.0;
    return true;
}

double Patch::correlation(const Patch& other) const {
    if (spread_ == 0.0 || other.spread_ == 0.0) return 0.0;
    double product = 0.0;
    for (std::size_t k = 0; k < values_.size(); ++k) product += values_[k] * other.values_[k];
    const double count = static_cast<double>(values_.size());
    return (product - count * mean_ * other.mean_) / (spread_ * other.spread_);
}

void patch_scores(const ImagePair& pair, Vec2 center, const Vec2* candidates, const Warp* warps, int count, int radius,
                  double* scores) {
    Patch reference(radius), seen(radius);
    const bool usable = reference.sample(pair.current, center, Warp{});
    for (int k = 0; k < count; ++k) {
        scores[k] = usable && seen.sample(pair.previous, candidates[k], warps[k]) ? reference.correlation(seen) : kNan;
    }
}

namespace {

struct Slopes {
    Symmetric2 normal;
    Vec2 right;
    double squares = 0.0;
};

// Gradients along the previous image's axes are those along the patch's axes times the inverse transposed warp.
Slopes slopes(const Patch& reference, const Patch& wide, const Warp& warp, double gain, double seen_mean) {
    const int radius = reference.radius(), width = 2 * radius + 3;
    const double determinant = warp.xx * warp.yy - warp.xy * warp.yx;
    const std::vector<double>&grey = reference.values(), &seen = wide.values();
    Slopes sums;
    std::size_t k = 0;
    for (int row = 1; row <= 2 * radius + 1; ++row) {
        for (int column = 1; column <= 2 * radius + 1; ++column, ++k) {
            const std::size_t at = static_cast<std::size_t>(row * width + column);
            const double across = 0.5 * (seen[at + 1] - seen[at - 1]);
            const double down = 0.5 * (seen[at + static_cast<std::size_t>(width)] -
                                       seen[at - static_cast<std::size_t>(width)]);
            const double gx = gain * (warp.yy * across - warp.yx * down) / determinant;
            const double gy = gain * (warp.xx * down - warp.xy * across) / determinant;
            const double difference = (grey[k] - reference.mean()) - gain * (seen[at] - seen_mean);
            sums.normal.xx += gx * gx;
            sums.normal.xy += gx * gy;
            sums.normal.yy += gy * gy;
            sums.right += Vec2{gx * difference, gy * difference};
            sums.squares += difference * difference;
        }
    }
    return sums;
}

// Gauss-Newton step. Along a straight edge only noise answers: a direction that is kWeak times weaker than the other
// stays where it was, and its information is taken away.
Vec2 solve(Symmetric2& normal, Vec2 right) {
    const double half = 0.5 * (normal.xx + normal.yy), skew = 0.5 * (normal.xx - normal.yy);
    const double radius = std::hypot(skew, normal.xy), strong = half + radius, weak = half - radius;
    if (!(strong > 0.0)) return {0.0, 0.0};
    if (weak < kWeak * strong) {
        const double angle = 0.5 * std::atan2(normal.xy, skew);
        const Vec2 along{std::cos(angle), std::sin(angle)};
        normal = {strong * along.x * along.x, strong * along.x * along.y, strong * along.y * along.y};
        return (dot(along, right) / strong) * along;
    }
    const double determinant = strong * weak;
    return {(normal.yy * right.x - normal.xy * right.y) / determinant,
            (normal.xx * right.y - normal.xy * right.x) / determinant};
}

}  // namespace

Alignment align_patch(const ImagePair& pair, Vec2 center, Vec2 start, const Warp& warp, int radius, int steps) {
    Alignment result{start, kNan, kNan, {}};
    Patch reference(radius), seen(radius), wide(radius + 1);
    if (!reference.sample(pair.current, center, Warp{}) || reference.spread() == 0.0) return result;
    if (std::abs(warp.xx * warp.yy - warp.xy * warp.yx) < 1e-3) return result;
    for (int step = 0; step <= steps; ++step) {
        if (!seen.sample(pair.previous, result.position, warp) || !wide.sample(pair.previous, result.position, warp)) {
            return {result.position, kNan, kNan, {}};
        }
        result.score = reference.correlation(seen);
        const double gain = seen.spread() > 0.0 ? reference.spread() / seen.spread() : 1.0;
        Slopes sums = slopes(reference, wide, warp, gain, seen.mean());
        Vec2 move = solve(sums.normal, sums.right);
        result.normal = sums.normal;
        result.residual = std::sqrt(sums.squares / static_cast<double>(reference.values().size()));
        if (step == steps) break;
        const double length = norm(move);
        if (!(length > kStill)) break;
        if (length > kLeap) move = (kLeap / length) * move;
        result.position += move;
    }
    return result;
}

}  // namespace ffseg
