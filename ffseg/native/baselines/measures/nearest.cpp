#include "baselines/measures/nearest.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace ffseg::measures {
namespace {

// Points sorted into square cells, about one point a cell along a boundary of one point a pixel.
class Cells {
public:
    explicit Cells(const std::vector<Vec2>& points) {
        for (const Vec2 p : points) box_.add(p);
        const double extent = std::max({box_.x1 - box_.x0, box_.y1 - box_.y0, 1.0});
        side_ = std::max(kSide, extent / kMostCells);
        columns_ = 1 + static_cast<int>((box_.x1 - box_.x0) / side_);
        rows_ = 1 + static_cast<int>((box_.y1 - box_.y0) / side_);
        first_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) + 1, 0);
        for (const Vec2 p : points) ++first_[cell(column(p), row(p)) + 1];
        for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
        sorted_.resize(points.size());
        std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
        for (const Vec2 p : points) sorted_[next[cell(column(p), row(p))]++] = p;
    }

    // Rings of cells round the point's own, until none that is left can hold a nearer point.
    double nearest(Vec2 p) const {
        const int c = std::clamp(column(p), 0, columns_ - 1), r = std::clamp(row(p), 0, rows_ - 1);
        const double outside = std::max({box_.x0 - p.x, p.x - box_.x1, box_.y0 - p.y, p.y - box_.y1, 0.0});
        double best = std::numeric_limits<double>::infinity();
        for (int ring = 0; ring <= std::max(columns_, rows_); ++ring) {
            const double reach = std::max((ring - 1) * side_, 0.0);
            if (outside == 0.0 && best <= reach * reach) break;
            scan_ring(c, r, ring, p, best);
        }
        return std::sqrt(best);
    }

private:
    static constexpr double kSide = 4.0, kMostCells = 2048.0;

    int column(Vec2 p) const { return static_cast<int>(std::floor((p.x - box_.x0) / side_)); }
    int row(Vec2 p) const { return static_cast<int>(std::floor((p.y - box_.y0) / side_)); }
    std::size_t cell(int c, int r) const {
        return static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(c);
    }

    void scan_ring(int c, int r, int ring, Vec2 p, double& best) const {
        const int top = std::max(r - ring, 0), bottom = std::min(r + ring, rows_ - 1);
        for (int y = top; y <= bottom; ++y) {
            const bool whole = y == r - ring || y == r + ring;
            const int step = whole || ring == 0 ? 1 : 2 * ring;
            for (int x = c - ring; x <= c + ring; x += step) {
                if (x >= 0 && x < columns_) scan(cell(x, y), p, best);
            }
        }
    }

    void scan(std::size_t at, Vec2 p, double& best) const {
        for (std::size_t i = first_[at]; i < first_[at + 1]; ++i) best = std::min(best, norm2(sorted_[i] - p));
    }

    Box box_;
    double side_ = 1.0;
    int columns_ = 1, rows_ = 1;
    std::vector<std::size_t> first_;
    std::vector<Vec2> sorted_;
};

}  // namespace

std::vector<double> nearest_distances(const std::vector<Vec2>& points, const std::vector<Vec2>& others) {
    std::vector<double> distances(points.size(), std::numeric_limits<double>::infinity());
    if (others.empty()) return distances;
    const Cells cells(others);
    for (std::size_t i = 0; i < points.size(); ++i) distances[i] = cells.nearest(points[i]);
    return distances;
}

}  // namespace ffseg::measures
