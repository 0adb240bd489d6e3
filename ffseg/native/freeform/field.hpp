// Where a contour may go: the pixels no edge band, domain limit or image border occupies.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "common/lanes.hpp"
#include "common/vec.hpp"
#include "freeform/bitmap.hpp"

namespace ffseg::freeform {

struct RunMarks;

class Field {
public:
    static constexpr int kTileShift = 2;
    // Free space is known up to so many tiles away.
    static constexpr int kLevels = 4;

    // Edges are solid; the pixels round them are a band that stops samples, while the curve between two samples may
    // run through it. So do slits, which no two by two free pixels fit into: whether a front gets through a gap is
    // settled here and not by where its samples lie. Passages drawn 6 px wide stay open at every angle.
    // `domain` may be null.
    Field(const std::uint8_t* edges, const std::uint8_t* domain, int height, int width);

    // For contour.clearance: blocks the ground that can be reached from `starts` only through passages no disc of this
    // diameter fits through. Where it fits but cannot get to is blocked, with the passages that lead there; dead ends and
    // narrow passages between places it reaches stay free. False, with nothing changed, if it fits at none of the starts.
    bool close_passages(const std::uint8_t* edges, const std::vector<Vec2>& starts, double clearance);

    int width() const { return width_; }
    int height() const { return height_; }

    FFSEG_INLINE Vec2 clamp(Vec2 p) const {
        constexpr double kInside = 0.5 - 1e-6;
        return {std::min(std::max(p.x, -kInside), width_ - 1 + kInside),
                std::min(std::max(p.y, -kInside), height_ - 1 + kInside)};
    }
    // Beyond the image everything is outside the domain: a curve through samples inside it may bulge out.
    bool blocked(Vec2 p) const { return at(p) != 0; }
    unsigned look(Vec2 p) const { return at(p); }
    // Where the pixels nearest to four points are kept, to be looked up; points beyond the image belong to its border.
    FFSEG_INLINE std::array<std::size_t, 4> cells(Float4 x, Float4 y) const {
        const Float4 first = all(1.0f);
        const Int4 column = truncated(smaller(larger(x + 1.5f, first), all(static_cast<float>(width_))));
        const Int4 row = truncated(smaller(larger(y + 1.5f, first), all(static_cast<float>(height_))));
        std::array<std::size_t, 4> found;
        for (int j = 0; j < 4; ++j) {
            found[j] = static_cast<std::size_t>(row[j]) * stride_ + static_cast<std::size_t>(column[j]);
        }
        return found;
    }
    bool blocked(std::size_t cell) const { return blocked_[cell] != 0; }
    // All that the pixels nearest to some points hold.
    template <std::size_t kFours>
    FFSEG_INLINE unsigned look(const std::array<Float4, kFours>& x, const std::array<Float4, kFours>& y) const {
        unsigned seen = 0;
        for (std::size_t q = 0; q < kFours; ++q) {
            const auto found = cells(x[q], y[q]);
            for (int j = 0; j < 4; ++j) seen |= blocked_[found[j]];
        }
        return seen;
    }
    static bool is_solid(unsigned cell) { return cell >= kEdge; }
    bool outside_domain(Vec2 p) const { return at(p) >= kOutside; }
    // Is the centre of a solid pixel in the box?
    bool holds_solid(const Box& box) const {
        const Vec2 low = clamp({box.x0, box.y0}), high = clamp({box.x1, box.y1});
        return holds_solid(static_cast<int>(std::ceil(low.x)), static_cast<int>(std::floor(high.x)),
                           static_cast<int>(std::ceil(low.y)), static_cast<int>(std::floor(high.y)));
    }
    // Does the closed polygon hold the centre of a solid pixel (even-odd)?
    bool encloses_solid(const Vec2* polygon, std::size_t count) const;
    // A lower bound of the distance from p to anything blocked, known in steps of a tile up to kLevels tiles.
    double free_reach(Vec2 p) const {
        const int column = static_cast<int>(p.x + 0.5), row = static_cast<int>(p.y + 0.5);
        // as unsigned, so that negative ones fail too
        if (static_cast<unsigned>(column) >= static_cast<unsigned>(width_)) return 0.0;
        if (static_cast<unsigned>(row) >= static_cast<unsigned>(height_)) return 0.0;
        return reach_[static_cast<std::size_t>(row >> kTileShift) * tiles_x_ + (column >> kTileShift)];
    }

    // Does anything blocked lie so many pixels from the pixel nearest to p, or less, along each axis?
    FFSEG_INLINE bool blocked_within(Vec2 p, int far) const {
        const int column = static_cast<int>(p.x + 1.5), row = static_cast<int>(p.y + 1.5);
        const int left = std::max(column - far, 0), right = std::min(column + far, width_ + 1);
        for (int y = std::max(row - far, 0); y <= std::min(row + far, height_ + 1); ++y) {
            const std::uint8_t* const cells = &blocked_[static_cast<std::size_t>(y) * stride_];
            for (int x = left; x <= right; ++x) {
                if (cells[x] != 0) return true;
            }
        }
        return false;
    }

    // The place of a pixel in the image, row by row.
    std::size_t pixel(Vec2 p) const {
        return static_cast<std::size_t>(p.y + 0.5) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(p.x + 0.5);
    }
    // Where tiles are named, row by row, for points clamped to the image.
    std::size_t num_tiles() const { return reach_.size(); }
    std::size_t tile(Vec2 p) const {
        const auto column = static_cast<std::size_t>(p.x + 0.5), row = static_cast<std::size_t>(p.y + 0.5);
        return (row >> kTileShift) * tiles_x_ + (column >> kTileShift);
    }

private:
    static constexpr std::uint8_t kBand = 1, kEdge = 2, kOutside = 5;  // an edge pixel is kBand | kEdge
    std::uint8_t at(Vec2 p) const {
        const int column = std::clamp(static_cast<int>(p.x + 1.5), 0, width_ + 1);
        const int row = std::clamp(static_cast<int>(p.y + 1.5), 0, height_ + 1);
        return blocked_[static_cast<std::size_t>(row) * stride_ + column];
    }
    bool holds_solid(int left, int right, int top, int bottom) const;
    std::size_t cell(int x, int y) const { return (static_cast<std::size_t>(y) + 1) * stride_ + x + 1; }
    void mark_edges(const std::uint8_t* edges, std::vector<std::uint8_t>& occupied, RunMarks& held);
    bool read_row(const std::uint8_t* edges, int y, std::uint8_t* row, std::uint8_t* flags,
                  std::vector<std::uint8_t>& occupied) const;
    void mark_outside(const std::uint8_t* domain, std::vector<std::uint8_t>& occupied, RunMarks& held);
    void build_tiles();
    void shut_slits(const RunMarks& held);
    void measure_reach(std::vector<std::uint8_t>& occupied);

    int height_, width_;
    std::size_t stride_, tiles_x_, tiles_y_;
    std::vector<std::uint8_t> blocked_;  // (H + 2) x (W + 2), one ring of outside
    std::vector<std::uint8_t> reach_;    // one for every tile, in pixels
};

}  // namespace ffseg::freeform
