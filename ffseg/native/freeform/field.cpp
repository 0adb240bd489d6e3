#include "freeform/field.hpp"

#include <cmath>
#include <cstring>

namespace ffseg {
namespace {

// Squared distance transform of one line (lower envelope of parabolas; Felzenszwalb and Huttenlocher 2012).
void distance_line(const std::vector<double>& f, std::vector<double>& out, std::vector<int>& apex,
                   std::vector<double>& bound) {
    const int n = static_cast<int>(f.size());
    int k = 0;
    apex[0] = 0;
    bound[0] = -1e18;
    bound[1] = 1e18;
    for (int q = 1; q < n; ++q) {
        double s = 0.0;
        do {
            const int v = apex[k];
            s = ((f[q] + static_cast<double>(q) * q) - (f[v] + static_cast<double>(v) * v)) / (2.0 * (q - v));
        } while (s <= bound[k] && --k >= 0);
        ++k;
        apex[k] = q;
        bound[k] = s;
        bound[k + 1] = 1e18;
    }
    k = 0;
    for (int q = 0; q < n; ++q) {
        while (bound[k + 1] < q) ++k;
        const double d = q - apex[k];
        out[q] = d * d + f[apex[k]];
    }
}

}  // namespace

Field::Field(const std::uint8_t* edges, const std::uint8_t* domain, int height, int width)
    : height_(height),
      width_(width),
      stride_(static_cast<std::size_t>(width) + 2),
      tiles_x_(static_cast<std::size_t>((width - 1) >> kTileShift) + 1),
      tiles_y_(static_cast<std::size_t>((height - 1) >> kTileShift) + 1),
      blocked_((static_cast<std::size_t>(height) + 2) * stride_) {
    mark_edges(edges);
    mark_outside(domain);
    build_tiles();
}

void Field::mark_edges(const std::uint8_t* edges) {
    std::vector<std::size_t> found;
    for (int y = 0; y < height_; ++y) {
        const std::uint8_t* row = edges + static_cast<std::size_t>(y) * width_;
        int x = 0;
        while (x < width_) {
            std::uint64_t eight = 0;
            if (x + 8 <= width_) {
                std::memcpy(&eight, row + x, 8);
                if (eight == 0) {
                    x += 8;
                    continue;
                }
            }
            if (row[x] != 0) found.push_back((static_cast<std::size_t>(y) + 1) * stride_ + x + 1);
            ++x;
        }
    }
    for (const std::size_t at : found) {
        for (const std::size_t row : {at - stride_, at, at + stride_}) {
            for (const std::size_t near : {row - 1, row, row + 1}) blocked_[near] = kBand;
        }
    }
    for (const std::size_t at : found) blocked_[at] = kEdge;
    for (const std::size_t at : found) {  // close the diagonal steps: an edge is a 4-connected chain of solid pixels
        const std::size_t below = at + stride_;
        if (blocked_[below] == kEdge) continue;
        const bool left = blocked_[below - 1] == kEdge && blocked_[at - 1] != kEdge;
        const bool right = blocked_[below + 1] == kEdge && blocked_[at + 1] != kEdge;
        if (left || right) blocked_[below] = kEdge;
    }
}

void Field::mark_outside(const std::uint8_t* domain) {
    const std::size_t rows = static_cast<std::size_t>(height_) + 2;
    std::memset(blocked_.data(), kOutside, stride_);
    std::memset(blocked_.data() + (rows - 1) * stride_, kOutside, stride_);
    for (std::size_t y = 0; y < rows; ++y) {
        blocked_[y * stride_] = kOutside;
        blocked_[(y + 1) * stride_ - 1] = kOutside;
    }
    if (domain == nullptr) return;
    for (int y = 0; y < height_; ++y) {
        for (int x = 0; x < width_; ++x) {
            if (domain[static_cast<std::size_t>(y) * width_ + x] != 0) continue;
            blocked_[(static_cast<std::size_t>(y) + 1) * stride_ + x + 1] = kOutside;
        }
    }
}

void Field::build_tiles() {
    constexpr int kTile = 1 << kTileShift;
    std::vector<std::uint8_t> occupied(tiles_x_ * tiles_y_);
    for (int y = 0; y < height_; ++y) {
        const std::uint8_t* row = blocked_.data() + (static_cast<std::size_t>(y) + 1) * stride_ + 1;
        std::uint8_t* tiles = occupied.data() + static_cast<std::size_t>(y >> kTileShift) * tiles_x_;
        for (int x = 0; x < width_; x += kTile) {
            std::uint64_t eight = 0;
            std::memcpy(&eight, row + x, static_cast<std::size_t>(std::min(kTile, width_ - x)));
            tiles[x >> kTileShift] |= static_cast<std::uint8_t>(eight != 0);
        }
    }
    crowded_.assign(tiles_x_ * tiles_y_, 0);
    const int columns = static_cast<int>(tiles_x_), rows = static_cast<int>(tiles_y_);
    for (int r = 0; r < rows; ++r) {
        for (int c = 0; c < columns; ++c) {
            // The last row and column of tiles may be cut, so their neighbours lie near the border as well.
            bool any = r == 0 || c == 0 || r >= rows - 2 || c >= columns - 2;
            for (int v = r - 1; v <= r + 1 && !any; ++v) {
                for (int u = c - 1; u <= c + 1 && !any; ++u) any = occupied[static_cast<std::size_t>(v) * tiles_x_ + u];
            }
            crowded_[static_cast<std::size_t>(r) * tiles_x_ + c] = any;
        }
    }
}

std::vector<float> Field::squared_distance(const std::vector<std::uint8_t>& zero) const {
    constexpr double kFar = 1e9;
    const std::size_t columns = stride_, rows = zero.size() / columns;
    std::vector<float> squared(zero.size());
    const std::size_t longest = std::max(rows, columns);
    std::vector<double> line(columns), out(columns), bound(longest + 1);
    std::vector<int> apex(longest);
    for (std::size_t y = 0; y < rows; ++y) {
        for (std::size_t x = 0; x < columns; ++x) line[x] = zero[y * columns + x] != 0 ? 0.0 : kFar;
        distance_line(line, out, apex, bound);
        for (std::size_t x = 0; x < columns; ++x) squared[y * columns + x] = static_cast<float>(out[x]);
    }
    line.resize(rows);
    out.resize(rows);
    for (std::size_t x = 0; x < columns; ++x) {
        for (std::size_t y = 0; y < rows; ++y) line[y] = squared[y * columns + x];
        distance_line(line, out, apex, bound);
        for (std::size_t y = 0; y < rows; ++y) squared[y * columns + x] = static_cast<float>(out[y]);
    }
    return squared;
}

void Field::grow(double radius) {
    std::vector<std::uint8_t> edges(blocked_.size());
    for (std::size_t at = 0; at < edges.size(); ++at) edges[at] = blocked_[at] == kEdge;
    const std::vector<float> squared = squared_distance(edges);
    for (std::size_t at = 0; at < edges.size(); ++at) {
        if (blocked_[at] <= kBand && squared[at] < radius * radius) blocked_[at] = kEdge;
    }
    build_tiles();
}

void Field::close_passages(const std::vector<std::uint8_t>& reached, const Field& grown, double radius) {
    std::vector<std::uint8_t> region(blocked_.size());
    for (int y = 0; y < height_; ++y) {
        for (int x = 0; x < width_; ++x) region[cell(x, y)] = reached[static_cast<std::size_t>(y) * width_ + x];
    }
    // Samples stop up to a pixel before what is blocked, so the region falls short of all that has clearance by as much.
    const double near = radius + 1.0;
    const std::vector<float> squared = squared_distance(region);
    std::vector<std::uint8_t> seen(blocked_.size());
    for (std::size_t at = 0; at < seen.size(); ++at) seen[at] = blocked_[at] != 0 || squared[at] <= near * near;
    std::vector<std::size_t> pocket;
    for (std::size_t first = stride_; first + stride_ < seen.size(); ++first) {
        if (seen[first] != 0) continue;
        pocket.assign(1, first);
        seen[first] = 1;
        bool open = false;
        for (std::size_t at = 0; at < pocket.size(); ++at) {
            const std::size_t here = pocket[at];
            open = open || grown.blocked_[here] == 0;
            for (const std::size_t next : {here - 1, here + 1, here - stride_, here + stride_}) {
                if (seen[next] != 0) continue;
                seen[next] = 1;
                pocket.push_back(next);
            }
        }
        if (!open) continue;
        for (const std::size_t at : pocket) blocked_[at] = kEdge;
    }
    build_tiles();
}

}  // namespace ffseg
