// Where a contour may go: pixels outside edge bands, inside the domain and the image.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "common/lanes.hpp"
#include "common/vec.hpp"
#include "freeform/evolution.hpp"
#include "freeform/field/cells.hpp"

namespace ffseg::field {

class Field {
public:
    // Edges are solid. The pixels round them are a band that stops samples, while the curve between two samples may
    // cross it. Slits, into which no free square of two by two pixels fits, are blocked like the band: so the edge map
    // decides whether a front passes a gap, and not the places of its samples. Passages drawn 6 px wide stay open at
    // every angle. `domain` may be null.
    Field(const std::uint8_t* edges, const std::uint8_t* domain, int height, int width);

    // For contour.clearance: blocks pixels that can be reached from `starts` only through passages too narrow for a
    // disc of this diameter, in the image or on the ground plane. Places where it fits but which it cannot reach are
    // blocked, with the passages leading there; dead ends, and narrow passages between reachable places, stay free.
    // False, with nothing changed, if it fits at none of the starts.
    bool close_passages(const std::uint8_t* edges, const std::vector<Vec2>& starts, double clearance,
                        const freeform::Plane& plane);

    int width() const { return cells_.width; }
    int height() const { return cells_.height; }

    FFSEG_INLINE Vec2 clamp(Vec2 p) const {
        constexpr double kInside = 0.5 - 1e-6;
        return {std::min(std::max(p.x, -kInside), cells_.width - 1 + kInside),
                std::min(std::max(p.y, -kInside), cells_.height - 1 + kInside)};
    }
    // The outside of the image is outside the domain: a curve through samples inside it may bulge out.
    bool blocked(Vec2 p) const { return at(p) != 0; }
    unsigned contents(Vec2 p) const { return at(p); }
    // Does the image contain p and this many pixels round it?
    FFSEG_INLINE bool holds(Vec2 p, double round) const {
        return (p.x >= round) & (p.y >= round) & (p.x <= cells_.width - 1 - round) & (p.y <= cells_.height - 1 - round);
    }
    // `blocked` for points inside the image.
    FFSEG_INLINE bool blocked_inside(Vec2 p) const {
        const auto column = static_cast<unsigned>(static_cast<int>(p.x + 1.5));
        const auto row = static_cast<unsigned>(static_cast<int>(p.y + 1.5));
        return cells_.blocked[row * cells_.stride + column] != 0;
    }
    // Indices of the pixels nearest to four points; points outside the image belong to its border.
    FFSEG_INLINE std::array<std::size_t, 4> cells(Float4 x, Float4 y) const {
        const Float4 first = all(1.0f);
        const Int4 column = truncated(smaller(larger(x + 1.5f, first), all(static_cast<float>(cells_.width))));
        const Int4 row = truncated(smaller(larger(y + 1.5f, first), all(static_cast<float>(cells_.height))));
        std::array<std::size_t, 4> found;
        for (int j = 0; j < 4; ++j) {
            found[j] = static_cast<std::size_t>(static_cast<unsigned>(row[j])) * cells_.stride +
                       static_cast<unsigned>(column[j]);
        }
        return found;
    }
    bool blocked(std::size_t cell) const { return cells_.blocked[cell] != 0; }
    // The combined states of the pixels nearest to some points.
    template <std::size_t kFours>
    FFSEG_INLINE unsigned contents(const std::array<Float4, kFours>& x, const std::array<Float4, kFours>& y) const {
        unsigned seen = 0;
        for (std::size_t q = 0; q < kFours; ++q) {
            const auto found = cells(x[q], y[q]);
            for (int j = 0; j < 4; ++j) seen |= cells_.blocked[found[j]];
        }
        return seen;
    }
    static bool is_solid(unsigned cell) { return cell >= kEdge; }
    bool outside_domain(Vec2 p) const { return at(p) >= kOutside; }
    // Is the centre of a solid pixel in the box?
    bool holds_solid(const Box& box) const {
        const Vec2 low = clamp({box.x0, box.y0}), high = clamp({box.x1, box.y1});
        return field::holds_solid(cells_, static_cast<int>(std::ceil(low.x)), static_cast<int>(std::floor(high.x)),
                                  static_cast<int>(std::ceil(low.y)), static_cast<int>(std::floor(high.y)));
    }
    // Does the closed polygon contain the centre of a solid pixel (even-odd)?
    bool encloses_solid(const Vec2* polygon, std::size_t count) const;
    // A lower bound of the distance from p to anything blocked, known in steps of a tile up to kLevels tiles.
    double free_reach(Vec2 p) const {
        const int column = static_cast<int>(p.x + 0.5), row = static_cast<int>(p.y + 0.5);
        // as unsigned, so that negative ones fail too
        if (static_cast<unsigned>(column) >= static_cast<unsigned>(cells_.width)) return 0.0;
        if (static_cast<unsigned>(row) >= static_cast<unsigned>(cells_.height)) return 0.0;
        return cells_.reach[static_cast<std::size_t>(row >> kTileShift) * cells_.tiles_x + (column >> kTileShift)];
    }

    // Is anything blocked within this many pixels along each axis of the pixel nearest to p?
    FFSEG_INLINE bool blocked_within(Vec2 p, int far) const {
        const int column = static_cast<int>(p.x + 1.5), row = static_cast<int>(p.y + 1.5);
        const int left = std::max(column - far, 0), right = std::min(column + far, cells_.width + 1);
        for (int y = std::max(row - far, 0); y <= std::min(row + far, cells_.height + 1); ++y) {
            const std::uint8_t* const cells = &cells_.blocked[static_cast<std::size_t>(y) * cells_.stride];
            for (int x = left; x <= right; ++x) {
                if (cells[x] != 0) return true;
            }
        }
        return false;
    }

    // The same for one pixel and points clamped to the image.
    FFSEG_INLINE bool blocked_beside(Vec2 p) const {
        const auto column = static_cast<std::size_t>(p.x + 0.5), row = static_cast<std::size_t>(p.y + 0.5);
        const std::uint8_t* const first = &cells_.blocked[row * cells_.stride + column];
        unsigned seen = 0;
        for (std::size_t y = 0; y < 3; ++y) {
            const std::uint8_t* const cells = first + y * cells_.stride;
            seen |= static_cast<unsigned>(cells[0]) | cells[1] | cells[2];
        }
        return seen != 0;
    }
    // The index of a pixel, row by row.
    std::size_t pixel(Vec2 p) const {
        return static_cast<std::size_t>(p.y + 0.5) * static_cast<std::size_t>(cells_.width) +
               static_cast<std::size_t>(p.x + 0.5);
    }
    // The index of a tile, row by row, for points clamped to the image.
    std::size_t num_tiles() const { return cells_.reach.size(); }
    std::size_t tile(Vec2 p) const {
        const auto column = static_cast<std::size_t>(p.x + 0.5), row = static_cast<std::size_t>(p.y + 0.5);
        return (row >> kTileShift) * cells_.tiles_x + (column >> kTileShift);
    }

private:
    std::uint8_t at(Vec2 p) const {
        const int column = std::clamp(static_cast<int>(p.x + 1.5), 0, width() + 1);
        const int row = std::clamp(static_cast<int>(p.y + 1.5), 0, height() + 1);
        return cells_.blocked[static_cast<std::size_t>(row) * cells_.stride + column];
    }

    Cells cells_;
};

}  // namespace ffseg::field
