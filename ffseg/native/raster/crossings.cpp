#include "raster/crossings.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace ffseg::raster {
namespace {

// A step from the centre `column` of a row to the next, and the crossings found on it.
struct Step {
    double column;
    std::size_t index;
    double sum = 0.0;
    int count = 0;
};

// Steps along x by their rows, and in each by their columns.
struct Rows {
    int top = 0;
    std::vector<std::vector<Step>> steps;
};

Rows along_x(const std::vector<Vec2>& steps) {
    double top = std::numeric_limits<double>::infinity(), bottom = -top;
    for (const Vec2& step : steps) top = std::min(top, step.y), bottom = std::max(bottom, step.y);
    if (steps.empty()) return {};
    Rows found{static_cast<int>(std::floor(top)), {}};
    found.steps.resize(static_cast<int>(std::floor(bottom)) - found.top + 1);
    for (std::size_t i = 0; i < steps.size(); ++i) {
        const double column = std::floor(steps[i].x);
        if (column != steps[i].x)
            found.steps[static_cast<int>(std::floor(steps[i].y)) - found.top].push_back({column, i});
    }
    for (std::vector<Step>& row : found.steps) {
        std::sort(row.begin(), row.end(), [](const Step& a, const Step& b) { return a.column < b.column; });
    }
    return found;
}

}  // namespace

void move_to_crossings(const std::vector<Edge>& edges, std::vector<Vec2>& steps) {
    Rows rows = along_x(steps);
    const double bottom = rows.top + static_cast<double>(rows.steps.size());
    for (const auto& [low, high, sign] : edges) {
        for (double y = std::max(std::ceil(low.y), static_cast<double>(rows.top)); y < high.y && y < bottom; ++y) {
            const double x = low.x + (high.x - low.x) * ((y - low.y) / (high.y - low.y));
            std::vector<Step>& row = rows.steps[static_cast<int>(y) - rows.top];
            const auto before = [](const Step& step, double column) { return step.column < column; };
            auto step = std::lower_bound(row.begin(), row.end(), std::floor(x - kMargin), before);
            for (; step != row.end() && step->column <= x + kMargin; ++step) {
                step->sum += x;
                ++step->count;
            }
        }
    }
    for (const std::vector<Step>& row : rows.steps) {
        for (const Step& step : row) {
            if (step.count == 0) continue;
            steps[step.index].x = std::clamp(step.sum / step.count, step.column + kMargin, step.column + 1.0 - kMargin);
        }
    }
}

}  // namespace ffseg::raster
