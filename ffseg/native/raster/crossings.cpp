#include "raster/crossings.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace ffseg::raster {
namespace {

// A step from the centre `column` of a row to the next, and the crossings found on it.
struct Step {
    double row, column;
    std::size_t index;
    double sum = 0.0;
    int count = 0;

    bool operator<(const Step& other) const { return row != other.row ? row < other.row : column < other.column; }
};

std::vector<Step> along_x(const std::vector<Vec2>& steps) {
    std::vector<Step> found;
    for (std::size_t i = 0; i < steps.size(); ++i) {
        const double column = std::floor(steps[i].x);
        if (column != steps[i].x) found.push_back({steps[i].y, column, i});
    }
    std::sort(found.begin(), found.end());
    return found;
}

}  // namespace

void move_to_crossings(const std::vector<Edge>& edges, std::vector<Vec2>& steps) {
    std::vector<Step> rows = along_x(steps);
    if (rows.empty()) return;
    const double top = rows.front().row, bottom = rows.back().row;
    for (const auto& [low, high, sign] : edges) {
        for (double y = std::max(std::ceil(low.y), top); y < high.y && y <= bottom; ++y) {
            const double x = low.x + (high.x - low.x) * ((y - low.y) / (high.y - low.y));
            auto step = std::lower_bound(rows.begin(), rows.end(), Step{y, std::floor(x - kMargin), 0});
            for (; step != rows.end() && step->row == y && step->column <= x + kMargin; ++step) {
                step->sum += x;
                ++step->count;
            }
        }
    }
    for (const Step& step : rows) {
        if (step.count == 0) continue;
        steps[step.index].x = std::clamp(step.sum / step.count, step.column + kMargin, step.column + 1.0 - kMargin);
    }
}

}  // namespace ffseg::raster
