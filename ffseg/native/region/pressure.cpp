#include "region/pressure.hpp"

#include <algorithm>
#include <cmath>

#include "common/lanes.hpp"
#include "raster/raster.hpp"

namespace ffseg::region {
namespace {

// Every so many pixels each way one is seen by the Gaussians.
constexpr int kEvery = 8;
// Pixels seen, to a side of the narrowest window.
constexpr int kNarrowest = 2;
// Pixels seen: how far an edge may leave its curve.
constexpr double kTolerance = 0.1;
// Fewer on a side say nothing.
constexpr double kMinPixels = 8.0;
// Grey levels squared, added to each variance: a start on a region of one colour must not be stopped by the next shade.
constexpr double kFloor = 9.0;

// A Gaussian of three channels; those an image lacks are constant.
struct Gaussian {
    double count = 0.0;
    std::array<double, 3> mean{};
    std::array<double, 6> precision{};  // as in the header, but those off the diagonal once
    double log_volume = 0.0;            // log of the determinant of the covariance
};

Gaussian gaussian(const Totals& totals, int channels) {
    Gaussian found;
    found.count = static_cast<double>(totals[0]);
    if (found.count < kMinPixels) return found;
    double m[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int c = 0; c < channels; ++c) found.mean[c] = static_cast<double>(totals[1 + c]) / found.count;
    std::size_t next = 1 + static_cast<std::size_t>(channels);
    for (int c = 0; c < channels; ++c) {
        for (int d = c; d < channels; ++d) {
            const double mixed = static_cast<double>(totals[next++]) / found.count;
            m[c][d] = m[d][c] = mixed - found.mean[c] * found.mean[d] + (c == d ? kFloor : 0.0);
        }
    }
    const double a = m[1][1] * m[2][2] - m[1][2] * m[1][2], b = m[0][2] * m[1][2] - m[0][1] * m[2][2],
                 c = m[0][1] * m[1][2] - m[0][2] * m[1][1];
    const double volume = m[0][0] * a + m[0][1] * b + m[0][2] * c;
    found.log_volume = std::log(volume);
    found.precision = {a / volume,
                       b / volume,
                       c / volume,
                       (m[0][0] * m[2][2] - m[0][2] * m[0][2]) / volume,
                       (m[0][1] * m[0][2] - m[0][0] * m[1][2]) / volume,
                       (m[0][0] * m[1][1] - m[0][1] * m[0][1]) / volume};
    return found;
}

std::array<double, 3> product(const std::array<double, 6>& m, const std::array<double, 3>& x) {
    return {m[0] * x[0] + m[1] * x[1] + m[2] * x[2], m[1] * x[0] + m[3] * x[1] + m[4] * x[2],
            m[2] * x[0] + m[4] * x[1] + m[5] * x[2]};
}

// Nine times the mean colour of a pixel and its neighbours.
template <int C>
FFSEG_INLINE std::array<int, C> nine_at(const Picture& from, int x, int y) {
    const std::ptrdiff_t stride = static_cast<std::ptrdiff_t>(from.width) * C;
    const std::ptrdiff_t left = x > 0 ? -C : 0, right = x + 1 < from.width ? C : 0;
    const std::uint8_t* const middle = from.pixels + y * stride + x * C;
    const std::uint8_t* const rows[3] = {y > 0 ? middle - stride : middle, middle,
                                         y + 1 < from.height ? middle + stride : middle};
    std::array<int, C> found{};
    for (const std::uint8_t* row : rows) {
        for (int c = 0; c < C; ++c) found[c] += row[c + left] + row[c] + row[c + right];
    }
    return found;
}

int seen(int side) { return (side + kEvery - 1) / kEvery; }

RowSums sums_of(const Picture& picture) {
    const int height = seen(picture.height), width = seen(picture.width);
    std::vector<std::uint8_t> colours;
    colours.reserve(static_cast<std::size_t>(height) * width * picture.channels);
    by_channels(picture.channels, [&](auto channels) {
        for (int y = 0; y < height; ++y) {
            for (int x = 0; x < width; ++x) {
                for (const int sum : nine_at<channels()>(picture, x * kEvery, y * kEvery)) {
                    colours.push_back(static_cast<std::uint8_t>((sum + 4) / 9));
                }
            }
        }
    });
    return RowSums({colours.data(), height, width, picture.channels});
}

LogOdds log_odds(const Gaussian& swept, const Gaussian& rest, double weight) {
    LogOdds found;
    found.centre = swept.mean;
    std::array<double, 3> step{};
    for (std::size_t c = 0; c < 3; ++c) step[c] = rest.mean[c] - swept.mean[c];
    const std::array<double, 3> pull = product(rest.precision, step);
    const double apart = step[0] * pull[0] + step[1] * pull[1] + step[2] * pull[2];
    found.level += 0.5 * weight * (apart + rest.log_volume - swept.log_volume);
    for (std::size_t k = 0; k < 6; ++k) {
        const double times = k == 1 || k == 2 || k == 4 ? 1.0 : 0.5;  // those off the diagonal stand for two
        found.square[k] = times * weight * (rest.precision[k] - swept.precision[k]);
    }
    for (std::size_t c = 0; c < 3; ++c) found.linear[c] = -weight * pull[c];
    return found;
}

// The pixels seen that contours enclose; those that close in run the other way round.
Spans enclosed(const Outlines& contours, bool closes_in, int height, int width) {
    std::vector<Vec2> points(contours.points.size());
    std::transform(contours.points.begin(), contours.points.end(), points.begin(),
                   [](Vec2 p) { return (1.0 / kEvery) * p; });
    std::vector<raster::Edge> edges;
    for (std::size_t c = 0; c + 1 < contours.offsets.size(); ++c) {
        const std::size_t begin = contours.offsets[c], count = contours.offsets[c + 1] - begin;
        Vec2* const first = points.data() + begin;
        if (closes_in && count > 0) std::reverse(first + 1, first + count);
        raster::append_contour(first, count, contours.degree, {width - 1.0, height - 1.0, kTolerance}, edges);
    }
    return raster::fill_spans(edges, height, width);
}

void add(const Totals& part, Totals& to) {
    for (std::size_t i = 0; i < to.size(); ++i) to[i] += part[i];
}

Totals sum(const std::vector<Totals>& parts) {
    Totals found(parts.front().size(), 0);
    for (const Totals& part : parts) add(part, found);
    return found;
}

}  // namespace

double LogOdds::at(std::array<double, 3> x) const {
    for (std::size_t c = 0; c < 3; ++c) x[c] -= centre[c];
    return level + x[0] * (linear[0] + square[0] * x[0] + square[1] * x[1] + square[2] * x[2]) +
           x[1] * (linear[1] + square[3] * x[1] + square[4] * x[2]) + x[2] * (linear[2] + square[5] * x[2]);
}

Pressure::Pressure(const Picture& picture, double weight, double window)
    : picture_(picture),
      sums_(sums_of(picture)),
      weight_(weight),
      cell_(window > 0 ? std::max(kNarrowest, static_cast<int>(window / kEvery + 0.5))
                       : std::max(sums_.height(), sums_.width())),
      columns_((sums_.width() + cell_ - 1) / cell_),
      rows_((sums_.height() + cell_ - 1) / cell_) {
    Spans whole;
    for (int y = 0; y < sums_.height(); ++y) whole.push_back({y, 0, sums_.width()});
    all_ = by_window(whole);
    odds_.resize(all_.size());
}

// The sums of the pixels in each window.
std::vector<Totals> Pressure::by_window(const Spans& spans) const {
    std::vector<Totals> found(static_cast<std::size_t>(columns_) * rows_, Totals(sums_.length(), 0));
    for (const Span& span : spans) {
        for (int begin = span.begin; begin < span.end;) {
            const int column = begin / cell_, end = std::min(span.end, (column + 1) * cell_);
            sums_.add({span.y, begin, end}, found[static_cast<std::size_t>(span.y / cell_) * columns_ + column]);
            begin = end;
        }
    }
    return found;
}

// The sums of a window and its neighbours.
Totals Pressure::round(const std::vector<Totals>& parts, int column, int row) const {
    Totals found(sums_.length(), 0);
    for (int y = std::max(row - 1, 0); y <= std::min(row + 1, rows_ - 1); ++y) {
        for (int x = std::max(column - 1, 0); x <= std::min(column + 1, columns_ - 1); ++x) {
            add(parts[static_cast<std::size_t>(y) * columns_ + x], found);
        }
    }
    return found;
}

void Pressure::fit(const Outlines& contours, bool closes_in) {
    const std::vector<Totals> inside = by_window(enclosed(contours, closes_in, sums_.height(), sums_.width()));
    const auto fitted = [&](const Totals& within, Totals outside, const LogOdds& unless) {
        for (std::size_t i = 0; i < within.size(); ++i) outside[i] -= within[i];
        const Gaussian one = gaussian(within, picture_.channels), other = gaussian(outside, picture_.channels);
        if (one.count < kMinPixels || other.count < kMinPixels) return unless;
        return closes_in ? log_odds(other, one, weight_) : log_odds(one, other, weight_);
    };
    const LogOdds whole = fitted(sum(inside), sum(all_), {});
    for (int row = 0; row < rows_; ++row) {
        for (int column = 0; column < columns_; ++column) {
            LogOdds& here = odds_[static_cast<std::size_t>(row) * columns_ + column];
            here = odds_.size() == 1 ? whole : fitted(round(inside, column, row), round(all_, column, row), whole);
        }
    }
}

void Pressure::prefetch(Vec2 p) const {
    const int column = std::clamp(static_cast<int>(p.x + 0.5), 0, picture_.width - 1);
    const int middle = std::clamp(static_cast<int>(p.y + 0.5), 0, picture_.height - 1);
    for (int row = std::max(middle - 1, 0); row <= std::min(middle + 1, picture_.height - 1); ++row) {
        FFSEG_PREFETCH(picture_.pixels +
                       (static_cast<std::ptrdiff_t>(row) * picture_.width + column) * picture_.channels);
    }
}

double Pressure::at(Vec2 p) const {
    const int column = std::clamp(static_cast<int>(p.x + 0.5), 0, picture_.width - 1);
    const int row = std::clamp(static_cast<int>(p.y + 0.5), 0, picture_.height - 1);
    std::array<double, 3> colour{};
    by_channels(picture_.channels, [&](auto channels) {
        const auto sums = nine_at<channels()>(picture_, column, row);
        for (std::size_t c = 0; c < sums.size(); ++c) colour[c] = sums[c] * (1.0 / 9);
    });
    const int side = cell_ * kEvery;
    const LogOdds& here = odds_[static_cast<std::size_t>(row / side) * columns_ + column / side];
    return std::min(std::max(here.at(colour), 0.0), 1.0);
}

bool Pressure::stops_near(Vec2 p) const {
    for (int dy = -2; dy <= 2; dy += 2) {
        for (int dx = -2; dx <= 2; dx += 2) {
            if (stops({p.x + dx, p.y + dy})) return true;
        }
    }
    return false;
}

double Pressure::reach(Vec2 from, Vec2 normal, double wanted) const {
    for (double ahead = wanted; ahead > 0; ahead = ahead > kNearest ? std::max(0.5 * ahead, kNearest) : 0) {
        const double share = at(from + ahead * normal);
        if (share >= kLeast) return share * ahead;
    }
    return 0.0;
}

}  // namespace ffseg::region
