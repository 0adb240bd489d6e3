#include "baselines/marching/start_band.hpp"

#include <algorithm>

namespace ffseg::marching {
namespace {

// Longer segments are cut so that the box round a piece holds few nodes.
constexpr double kPiece = 8.0;
// An outer neighbour of an inner node lies at most this far from the contour between them.
constexpr double kReach = 1.0;

double distance2(Vec2 p, Vec2 a, Vec2 b) {
    const Vec2 ab = b - a, ap = p - a;
    const double size = norm2(ab);
    const double t = size > 0 ? std::clamp(dot(ap, ab) / size, 0.0, 1.0) : 0.0;
    return norm2(ap - t * ab);
}

class Band {
public:
    Band(const Grid& grid, const std::uint8_t* inside) : grid_(grid), inside_(inside) {}

    void add(Vec2 a, Vec2 b) {
        const int x0 = low(std::min(a.x, b.x)), x1 = high(std::max(a.x, b.x), grid_.width);
        const int y0 = low(std::min(a.y, b.y)), y1 = high(std::max(a.y, b.y), grid_.height);
        for (int y = y0; y <= y1; ++y) {
            for (int x = x0; x <= x1; ++x) {
                if (!outer(x, y)) continue;
                const Vec2 p{static_cast<double>(x), static_cast<double>(y)};
                found_.push_back({std::sqrt(distance2(p, a, b)), grid_.node(x, y)});
            }
        }
    }

    std::vector<Arrival> nearest() {
        const auto before = [](const Arrival& a, const Arrival& b) {
            return a.node < b.node || (a.node == b.node && a.time < b.time);
        };
        std::sort(found_.begin(), found_.end(), before);
        const auto same = [](const Arrival& a, const Arrival& b) { return a.node == b.node; };
        found_.erase(std::unique(found_.begin(), found_.end(), same), found_.end());
        return std::move(found_);
    }

private:
    static int low(double v) { return static_cast<int>(std::clamp(std::ceil(v - kReach), 0.0, 1e6)); }
    static int high(double v, int size) {
        return static_cast<int>(std::clamp(std::floor(v + kReach), -1.0, size - 1.0));
    }
    bool in(int x, int y) const {
        return x >= 0 && y >= 0 && x < grid_.width && y < grid_.height &&
               inside_[static_cast<std::size_t>(y) * static_cast<std::size_t>(grid_.width) +
                       static_cast<std::size_t>(x)];
    }
    bool outer(int x, int y) const {
        return !in(x, y) && (in(x - 1, y) || in(x + 1, y) || in(x, y - 1) || in(x, y + 1));
    }

    const Grid& grid_;
    const std::uint8_t* inside_;
    std::vector<Arrival> found_;
};

}  // namespace

std::vector<Arrival> start_band(const Grid& grid, const std::uint8_t* inside, const std::vector<Vec2>& points,
                                const std::vector<std::size_t>& offsets) {
    Band band(grid, inside);
    for (std::size_t c = 0; c + 1 < offsets.size(); ++c) {
        const std::size_t begin = offsets[c], end = offsets[c + 1];
        for (std::size_t i = begin; i < end; ++i) {
            const Vec2 a = points[i], b = points[i + 1 < end ? i + 1 : begin];
            const double pieces = std::clamp(std::ceil(norm(b - a) / kPiece), 1.0, 1e5);
            for (double k = 0; k < pieces; ++k) {
                band.add(a + (k / pieces) * (b - a), a + ((k + 1) / pieces) * (b - a));
            }
        }
    }
    return band.nearest();
}

}  // namespace ffseg::marching
