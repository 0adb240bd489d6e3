#include "pairs/patches.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/lanes.hpp"

namespace ffseg::pairs {

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
// Sum of squared deviations below which a patch is flat: under half a grey level in the mean of a 9x9 patch.
constexpr double kFlat = 4.0;
// Pixels; after a Gauss-Newton step shorter than this the next one would change nothing that the noise does not.
constexpr double kStill = 0.05;
// Pixels; a longer step means that the linearisation does not hold.
constexpr double kLeap = 2.0;
// Ratio of the two curvatures of the fit below which a patch is an edge.
constexpr double kWeak = 0.05;

// Samples that are worked on side by side: a whole patch of the sizes in use, some rows of a larger one.
constexpr int kBlock = 289;

// Rows of samples in an image.
struct Rows {
    Vec2 first, across, down;  // the first sample, and the steps to the next one and to the next row
    int count, side;
};

// Where the samples lie: the pixel above and left of each, and how far to the right of it and below.
FFSEG_CLONES
void locate(const Rows& rows, std::uint32_t width, std::uint32_t* __restrict at, double* __restrict right,
            double* __restrict below) {
    for (int row = 0; row < rows.count; ++row) {
        const double x0 = rows.first.x + row * rows.down.x, y0 = rows.first.y + row * rows.down.y;
        const int k = row * rows.side;
        for (int column = 0; column < rows.side; ++column) {
            const double x = x0 + column * rows.across.x, y = y0 + column * rows.across.y;
            const std::int32_t left = static_cast<std::int32_t>(x), top = static_cast<std::int32_t>(y);
            at[k + column] = static_cast<std::uint32_t>(top) * width + static_cast<std::uint32_t>(left);
            right[k + column] = x - left;
            below[k + column] = y - top;
        }
    }
}

// Two pixels side by side.
std::uint16_t two(const std::uint8_t* pixels) { return static_cast<std::uint16_t>(pixels[0] | pixels[1] << 8); }

// Bilinear samples between the two pixels above and the two below.
FFSEG_CLONES
void blend(const std::uint16_t* above, const std::uint16_t* below, const double* right, const double* down, int count,
           double* __restrict out) {
    for (int k = 0; k < count; ++k) {
        const double a = above[k] & 255, b = above[k] >> 8, c = below[k] & 255, d = below[k] >> 8;
        const double first = a + right[k] * (b - a), second = c + right[k] * (d - c);
        out[k] = first + down[k] * (second - first);
    }
}

void sample_rows(const Picture& image, const Rows& rows, double* out) {
    std::uint32_t at[kBlock];
    std::uint16_t above[kBlock], below[kBlock];
    double right[kBlock], down[kBlock];
    locate(rows, static_cast<std::uint32_t>(image.width), at, right, down);
    const int count = rows.count * rows.side;
    for (int k = 0; k < count; ++k) {
        const std::uint8_t* here = image.pixels + at[k];
        above[k] = two(here);
        below[k] = two(here + image.width);
    }
    blend(above, below, right, down, count, out);
}

// The whole patch, and a ring of one pixel for its derivatives, must lie where four neighbours exist.
bool fits(const Picture& image, Vec2 center, const Warp& warp, int radius) {
    const double reach = radius + 1;
    const double across = reach * (std::abs(warp.xx) + std::abs(warp.xy));
    const double down = reach * (std::abs(warp.yx) + std::abs(warp.yy));
    return center.x - across >= 0 && center.y - down >= 0 && center.x + across < image.width - 1 &&
           center.y + down < image.height - 1;  // false for NaN too
}

}  // namespace

ImagePatch::ImagePatch(int radius, int stride) : radius_(radius), stride_(stride) {
    const std::size_t side = 2 * static_cast<std::size_t>(radius) / stride + 1;
    values_.resize(side * side);
}

bool ImagePatch::fill(const Picture& image, Vec2 center, const Warp& warp) {
    if (!fits(image, center, warp, radius_)) return false;
    const Vec2 right{warp.xx, warp.yx}, below{warp.xy, warp.yy};
    const Vec2 first = center - static_cast<double>(radius_) * (right + below);
    const double stride = stride_;
    const int side = 2 * radius_ / stride_ + 1, most = std::max(1, kBlock / side);
    for (int row = 0; row < side; row += most) {
        const Rows rows{first + row * stride * below, stride * right, stride * below, std::min(most, side - row), side};
        sample_rows(image, rows, values_.data() + static_cast<std::size_t>(row) * side);
    }
    return true;
}

bool ImagePatch::sample(const Picture& image, Vec2 center, const Warp& warp) {
    if (!fill(image, center, warp)) return false;
    double sum = 0.0, squares = 0.0;
    for (const double value : values_) {
        sum += value;
        squares += value * value;
    }
    mean_ = sum / static_cast<double>(values_.size());
    const double deviation = squares - sum * mean_;
    spread_ = deviation > kFlat ? std::sqrt(deviation) : 0.0;
    return true;
}

double ImagePatch::correlation(const ImagePatch& other) const {
    if (spread_ == 0.0 || other.spread_ == 0.0) return 0.0;
    double product = 0.0;
    for (std::size_t k = 0; k < values_.size(); ++k) product += values_[k] * other.values_[k];
    const double count = static_cast<double>(values_.size());
    return (product - count * mean_ * other.mean_) / (spread_ * other.spread_);
}

void patch_scores(const ImagePair& pair, Vec2 center, const Candidates& candidates, int radius, double hopeless,
                  double* scores) {
    ImagePatch sparse(radius, 2), sparse_seen(radius, 2), whole(radius), seen(radius);
    const bool usable = sparse.sample(pair.current, center, Warp{}) && whole.sample(pair.current, center, Warp{});
    for (std::size_t k = 0; k < candidates.places.size(); ++k) {
        scores[k] = kNan;
        const Vec2 place = candidates.places[k];
        const Warp& warp = candidates.warps[k];
        if (!usable || !sparse_seen.sample(pair.previous, place, warp)) continue;
        scores[k] = sparse.correlation(sparse_seen);
        if (scores[k] < hopeless) continue;
        seen.sample(pair.previous, place, warp);
        scores[k] = whole.correlation(seen);
    }
}

namespace {

struct Slopes {
    Symmetric2 normal;
    Vec2 right;
    double squares = 0.0;
};

struct Moments {
    double mean = 0.0, spread = 0.0, product = 0.0;
};

// Mean and spread of the inside of a patch that is one pixel wider, and its product with the reference.
Moments moments(const ImagePatch& reference, const ImagePatch& wide) {
    const int side = 2 * reference.radius() + 1, width = side + 2;
    double sum = 0.0, squares = 0.0, product = 0.0;
    for (int row = 0; row < side; ++row) {
        const double* seen = wide.values().data() + (row + 1) * width + 1;
        const double* grey = reference.values().data() + row * side;
        for (int column = 0; column < side; ++column) {
            sum += seen[column];
            squares += seen[column] * seen[column];
            product += seen[column] * grey[column];
        }
    }
    Moments found;
    const double count = static_cast<double>(side) * side;
    found.mean = sum / count;
    const double deviation = squares - sum * found.mean;
    found.spread = deviation > kFlat ? std::sqrt(deviation) : 0.0;
    found.product = product - sum * reference.mean();
    return found;
}

// Differences are taken along the patch's axes; the sums are turned into the previous image's at the end.
Slopes slopes(const ImagePatch& reference, const ImagePatch& wide, const Warp& warp, double gain, double seen_mean) {
    const int side = 2 * reference.radius() + 1, width = side + 2;
    Slopes sums;
    Symmetric2 own;
    Vec2 own_right;
    for (int row = 0; row < side; ++row) {
        const double* seen = wide.values().data() + (row + 1) * width + 1;
        const double* grey = reference.values().data() + row * side;
        for (int column = 0; column < side; ++column) {
            const double across = seen[column + 1] - seen[column - 1];
            const double down = seen[column + width] - seen[column - width];
            const double difference = (grey[column] - reference.mean()) - gain * (seen[column] - seen_mean);
            own.xx += across * across;
            own.xy += across * down;
            own.yy += down * down;
            own_right += Vec2{across * difference, down * difference};
            sums.squares += difference * difference;
        }
    }
    // Gradients in the image are the inverse transposed warp times those of the patch; central differences halve them.
    const double scale = 0.5 * gain / (warp.xx * warp.yy - warp.xy * warp.yx);
    const double a = scale * warp.yy, b = -scale * warp.yx, c = -scale * warp.xy, d = scale * warp.xx;
    sums.normal.xx = a * a * own.xx + 2 * a * b * own.xy + b * b * own.yy;
    sums.normal.xy = a * c * own.xx + (a * d + b * c) * own.xy + b * d * own.yy;
    sums.normal.yy = c * c * own.xx + 2 * c * d * own.xy + d * d * own.yy;
    sums.right = {a * own_right.x + b * own_right.y, c * own_right.x + d * own_right.y};
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
    ImagePatch reference(radius), wide(radius + 1);
    if (!reference.sample(pair.current, center, Warp{}) || reference.spread() == 0.0) return result;
    if (!(std::abs(warp.xx * warp.yy - warp.xy * warp.yx) > 1e-3)) return result;
    for (int step = 0; step <= steps; ++step) {
        if (!wide.fill(pair.previous, result.position, warp)) return {result.position, kNan, kNan, {}};
        const Moments seen = moments(reference, wide);
        result.score = seen.spread > 0.0 ? seen.product / (reference.spread() * seen.spread) : 0.0;
        const double gain = seen.spread > 0.0 ? reference.spread() / seen.spread : 1.0;
        Slopes sums = slopes(reference, wide, warp, gain, seen.mean);
        Vec2 move = solve(sums.normal, sums.right);
        result.normal = sums.normal;
        result.residual = std::sqrt(sums.squares / static_cast<double>(reference.values().size()));
        const double length = norm(move);
        if (step == steps) break;
        if (length > kLeap) move = (kLeap / length) * move;
        result.position += move;
        if (!(length > kStill)) break;
    }
    return result;
}

}  // namespace ffseg::pairs
