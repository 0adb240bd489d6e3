// The balloon's pressure by colour: what the front has swept, against the rest.
#pragma once
#include <array>
#include <cstddef>
#include <vector>

#include "common/picture.hpp"
#include "common/vec.hpp"
#include "region/sums.hpp"

namespace ffseg::region {

// Closed contours as runs of control points: contour c owns points[offsets[c] .. offsets[c + 1]).
struct Outlines {
    const std::vector<Vec2>& points;
    const std::vector<std::size_t>& offsets;
    int degree;
};

// 1 + weight times log(p_swept / p_rest) of two Gaussians, as a polynomial of a colour x off the centre.
struct LogOdds {
    std::array<double, 3> centre{}, linear{};
    std::array<double, 6> square{};  // 0 0, 0 1, 0 2, 1 1, 1 2, 2 2; those off the diagonal twice
    double level = 1.0;

    double at(std::array<double, 3> x) const;
};

// How likely each colour belongs to what was swept rather than to the rest, as two Gaussians have it: of the whole
// image, or of the surroundings of each of its windows. Colours are means of nine pixels, so that noise counts less;
// the Gaussians see every eighth pixel each way. Fitting costs the contour's length.
class Pressure {
public:
    // Below this share of the full pressure the front stands still.
    static constexpr double kLeast = 0.25;
    // It looks where a step would lead, then half as far, down to so many pixels.
    static constexpr double kNearest = 1.0;

    // `weight` > 0: of the log odds. `window`: pixels a side, each seen with its eight neighbours; 0 for the whole
    // image. The picture must live as long.
    Pressure(const Picture& picture, double weight, double window);

    // Fits both Gaussians to what the contours enclose and the rest; the other way round if they close in.
    void fit(const Outlines& contours, bool closes_in);

    // Has the pixels there brought near: a place in a large image is far from the last one.
    void prefetch(Vec2 p) const;
    // The share of the balloon's pressure there, 0 to 1.
    double at(Vec2 p) const;
    bool stops(Vec2 p) const { return at(p) < kLeast; }
    // Does it stop a front at p or two pixels from there?
    bool stops_near(Vec2 p) const;
    // How far from a point the front gets along `normal` in one step of at most `wanted`.
    double reach(Vec2 from, Vec2 normal, double wanted) const;

private:
    std::vector<Totals> by_window(const Spans& spans) const;
    Totals round(const std::vector<Totals>& parts, int column, int row) const;

    Picture picture_;
    RowSums sums_;
    double weight_;
    int cell_;  // pixels seen to a side of a window
    int columns_, rows_;
    std::vector<Totals> all_;  // of each window
    std::vector<LogOdds> odds_;
};

}  // namespace ffseg::region
