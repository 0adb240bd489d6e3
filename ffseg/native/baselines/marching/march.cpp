#include "baselines/marching/march.hpp"

#include <algorithm>

namespace ffseg::marching {

March::March(Grid size, const std::uint8_t* domain) : grid(size), time(size.size(), kNever) {
    constexpr double kBarred = std::numeric_limits<double>::quiet_NaN();
    const auto columns = static_cast<std::size_t>(grid.stride()), rows = static_cast<std::size_t>(grid.height) + 2;
    std::fill_n(time.begin(), columns, kBarred);
    std::fill_n(time.end() - static_cast<std::ptrdiff_t>(columns), columns, kBarred);
    for (std::size_t y = 0; y < rows; ++y) time[y * columns] = time[(y + 1) * columns - 1] = kBarred;
    if (domain == nullptr) return;
    for (int y = 0; y < grid.height; ++y) {
        double* row = time.data() + grid.node(0, y);
        for (int x = 0; x < grid.width; ++x) {
            if (*domain++ == 0) row[x] = kBarred;
        }
    }
}

void March::accept(const std::uint8_t* inside) {
    for (int y = 0; y < grid.height; ++y) {
        const std::int32_t first = grid.node(0, y);
        for (int x = 0; x < grid.width; ++x) {
            const std::int32_t node = first + x;
            if (*inside++ == 0 || std::isnan(time[node])) continue;
            time[node] = 0.0;
            start.push_back(node);
        }
    }
}

}  // namespace ffseg::marching
