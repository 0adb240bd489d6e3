#include "pairs/interest.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "common/lanes.hpp"

namespace ffseg::pairs {

namespace {

// Harris and Stephens' own constant.
constexpr double kHarris = 0.04;
// Part of the strongest response below which a corner is texture; OpenCV's and MATLAB's examples use the same.
constexpr double kHarrisFloor = 0.01;
// Pixels: one outline sample per cell, the strongest.
constexpr int kCell = 4;
// Grey levels per pixel; a weaker edge cannot be placed better than the threshold's parallax.
constexpr int kOutlineFloor = 4;
// Sobel's operator gives eight times the gradient.
constexpr int kSobelGain = 8;

void or_into(const std::uint8_t* from, std::uint8_t* __restrict to, int count) {
    for (int c = 0; c < count; ++c) to[c] |= from[c];
}

// One row of Sobel sums from vertical sums and differences, two longer.
FFSEG_CLONES
void sobel_row(const int* sum, const int* difference, int* __restrict across, int* __restrict down, int count) {
    for (int c = 0; c < count; ++c) {
        across[c] = sum[c + 2] - sum[c];
        down[c] = difference[c] + 2 * difference[c + 1] + difference[c + 2];
    }
}

// Sobel gradients of a window of the image; pixels outside the image repeat its border.
struct Gradients {
    int width, height;
    std::vector<int> dx, dy;

    Gradients(const Picture& image, int x, int y, int columns, int rows);
};

Gradients::Gradients(const Picture& image, int x, int y, int columns, int rows) : width(columns), height(rows) {
    const std::size_t size = static_cast<std::size_t>(columns) * rows;
    dx.resize(size);
    dy.resize(size);
    std::vector<int> sum(columns + 2), difference(columns + 2);
    for (int row = 0; row < rows; ++row) {
        const std::uint8_t* lines[3];
        for (int k = 0; k < 3; ++k) {
            const int at = std::clamp(y + row + k - 1, 0, image.height - 1);
            lines[k] = image.pixels + static_cast<std::size_t>(at) * image.width;
        }
        for (int column = 0; column < columns + 2; ++column) {
            const int at = std::clamp(x + column - 1, 0, image.width - 1);
            sum[column] = lines[0][at] + 2 * lines[1][at] + lines[2][at];
            difference[column] = lines[2][at] - lines[0][at];
        }
        int* across = dx.data() + static_cast<std::size_t>(row) * columns;
        int* down = dy.data() + static_cast<std::size_t>(row) * columns;
        sobel_row(sum.data(), difference.data(), across, down, columns);
    }
}

struct ProductRows {
    int *xx, *xy, *yy;
};

// Sums over three rows of the products of the gradients, one line of the window; below 2**22.
FFSEG_CLONES
void product_row(const int* dx, const int* dy, int width, ProductRows out) {
    int* __restrict xx = out.xx, * __restrict xy = out.xy, * __restrict yy = out.yy;
    for (int c = 0; c < width; ++c) {
        const int x0 = dx[c], x1 = dx[c + width], x2 = dx[c + 2 * width];
        const int y0 = dy[c], y1 = dy[c + width], y2 = dy[c + 2 * width];
        xx[c] = x0 * x0 + x1 * x1 + x2 * x2;
        xy[c] = x0 * y0 + x1 * y1 + x2 * y2;
        yy[c] = y0 * y0 + y1 * y1 + y2 * y2;
    }
}

FFSEG_CLONES
void response_row(ProductRows rows, int width, double* __restrict out) {
    for (int c = 0; c < width; ++c) {
        const double xx = rows.xx[c] + rows.xx[c + 1] + rows.xx[c + 2];
        const double xy = rows.xy[c] + rows.xy[c + 1] + rows.xy[c + 2];
        const double yy = rows.yy[c] + rows.yy[c + 1] + rows.yy[c + 2];
        out[c] = xx * yy - xy * xy - kHarris * (xx + yy) * (xx + yy);
    }
}

// Harris response of every pixel of the region's window, gradient products summed over 3x3 pixels.
std::vector<double> response(const Picture& image, const ComponentWindow& region) {
    const Gradients gradients(image, region.x - 1, region.y - 1, region.width + 2, region.height + 2);
    const int width = gradients.width;
    std::vector<int> products(3 * static_cast<std::size_t>(width));
    const ProductRows rows{products.data(), products.data() + width, products.data() + 2 * width};
    std::vector<double> found(region.mask.size());
    for (int row = 0; row < region.height; ++row) {
        const std::size_t at = static_cast<std::size_t>(row) * width;
        product_row(gradients.dx.data() + at, gradients.dy.data() + at, width, rows);
        response_row(rows, region.width, found.data() + static_cast<std::size_t>(row) * region.width);
    }
    return found;
}

// Is no neighbour inside the window stronger? Equal ones are peaks alike.
bool is_peak(const std::vector<double>& strength, const ComponentWindow& region, int column, int row) {
    const double own = strength[static_cast<std::size_t>(row) * region.width + column];
    for (int r = std::max(row - 1, 0); r <= std::min(row + 1, region.height - 1); ++r) {
        for (int c = std::max(column - 1, 0); c <= std::min(column + 1, region.width - 1); ++c) {
            if (strength[static_cast<std::size_t>(r) * region.width + c] > own) return false;
        }
    }
    return true;
}

// Vertex of the parabola through three values, within half a pixel; a plateau has none.
double vertex(double before, double middle, double after) {
    const double bend = before + after - 2.0 * middle;
    return bend < 0.0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0.0;
}

Vec2 refined(const std::vector<double>& strength, const ComponentWindow& region, std::size_t place) {
    const int column = static_cast<int>(place % region.width), row = static_cast<int>(place / region.width);
    const auto at = [&](int c, int r) {
        const int inside = std::clamp(r, 0, region.height - 1);
        return strength[static_cast<std::size_t>(inside) * region.width + std::clamp(c, 0, region.width - 1)];
    };
    const double middle = strength[place];
    return {region.x + column + vertex(at(column - 1, row), middle, at(column + 1, row)),
            region.y + row + vertex(at(column, row - 1), middle, at(column, row + 1))};
}

}  // namespace

ComponentWindow grown(const ComponentWindow& region, int by, int image_width, int image_height) {
    ComponentWindow wide;
    wide.x = std::max(region.x - by, 0);
    wide.y = std::max(region.y - by, 0);
    wide.width = std::min(region.x + region.width + by, image_width) - wide.x;
    wide.height = std::min(region.y + region.height + by, image_height) - wide.y;
    wide.mask.assign(static_cast<std::size_t>(wide.width) * wide.height, 0);
    std::vector<std::uint8_t> lines(static_cast<std::size_t>(wide.width) * region.height);  // grown across
    for (int row = 0; row < region.height; ++row) {
        std::uint8_t* line = lines.data() + static_cast<std::size_t>(row) * wide.width;
        for (int column = 0; column < region.width; ++column) {
            if (!region.holds(column, row)) continue;
            const int first = region.x + column - wide.x - by;
            while (column + 1 < region.width && region.holds(column + 1, row)) ++column;
            const int last = region.x + column - wide.x + by;
            std::fill(line + std::max(first, 0), line + std::min(last, wide.width - 1) + 1, std::uint8_t{1});
        }
    }
    for (int r = 0; r < wide.height; ++r) {
        const int at = wide.y + r - region.y;  // row of the region
        std::uint8_t* out = wide.mask.data() + static_cast<std::size_t>(r) * wide.width;
        for (int row = std::max(at - by, 0); row <= std::min(at + by, region.height - 1); ++row) {
            or_into(lines.data() + static_cast<std::size_t>(row) * wide.width, out, wide.width);
        }
    }
    return wide;
}

std::vector<Vec2> harris_points(const Picture& image, const ComponentWindow& region, int most) {
    const std::vector<double> strength = response(image, region);
    double strongest = 0.0;
    for (std::size_t k = 0; k < strength.size(); ++k) {
        if (region.mask[k]) strongest = std::max(strongest, strength[k]);
    }
    std::vector<std::size_t> peaks;
    for (std::size_t k = 0; k < strength.size(); ++k) {
        if (!region.mask[k] || !(strength[k] > kHarrisFloor * strongest)) continue;
        const int column = static_cast<int>(k % region.width), row = static_cast<int>(k / region.width);
        if (is_peak(strength, region, column, row)) peaks.push_back(k);
    }
    std::stable_sort(peaks.begin(), peaks.end(), [&](auto a, auto b) { return strength[a] > strength[b]; });
    peaks.resize(std::min(peaks.size(), static_cast<std::size_t>(most)));
    std::vector<Vec2> points;
    for (const std::size_t peak : peaks) points.push_back(refined(strength, region, peak));
    return points;
}

std::vector<Vec2> outline_points(const Picture& image, const ComponentWindow& region, int most) {
    const Gradients gradients(image, region.x, region.y, region.width, region.height);
    const int across = (region.width + kCell - 1) / kCell, down = (region.height + kCell - 1) / kCell;
    constexpr int least = kOutlineFloor * kOutlineFloor * kSobelGain * kSobelGain;
    std::vector<std::pair<int, std::size_t>> best(static_cast<std::size_t>(across) * down, {least, 0});
    std::vector<bool> found(best.size(), false);
    for (std::size_t k = 0; k < region.mask.size(); ++k) {
        const int square = gradients.dx[k] * gradients.dx[k] + gradients.dy[k] * gradients.dy[k];
        if (!region.mask[k] || square <= least) continue;
        const std::size_t cell = k / region.width / kCell * across + k % region.width / kCell;
        if (square > best[cell].first) best[cell] = {square, k};
        found[cell] = true;
    }
    std::vector<Vec2> all, points;
    for (std::size_t cell = 0; cell < best.size(); ++cell) {
        if (!found[cell]) continue;
        const std::size_t k = best[cell].second;
        all.push_back({static_cast<double>(region.x) + static_cast<double>(k % region.width),
                       static_cast<double>(region.y) + static_cast<double>(k / region.width)});
    }
    const std::size_t count = std::min(all.size(), static_cast<std::size_t>(most));
    const double last = static_cast<double>(all.size()) - 1.0;
    for (std::size_t k = 0; k < count; ++k) {
        // Evenly spread, the first and the last among them.
        const double place = count > 1 ? static_cast<double>(k) * last / (static_cast<double>(count) - 1.0) : 0.0;
        points.push_back(all[static_cast<std::size_t>(std::lround(place))]);
    }
    return points;
}

}  // namespace ffseg::pairs
