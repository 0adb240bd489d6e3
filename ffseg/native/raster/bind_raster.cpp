#include <nanobind/stl/vector.h>

#include <utility>
#include <vector>

#include "bindings.hpp"
#include "common/arrays.hpp"
#include "common/measures.hpp"
#include "raster/crossings.hpp"
#include "raster/raster.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using ffseg::Indices;
using ffseg::Points;
using Mask = ffseg::Array<std::uint8_t, nb::ndim<2>>;

// Beyond this, sums of products in the exact side test would overflow.
constexpr double kMaxCoordinate = 1e100;

void check_contours(const Indices& offsets, const Indices& degrees, std::size_t count) {
    const std::size_t contours = degrees.shape(0);
    ffseg::require(offsets.shape(0) == contours + 1 && offsets.data()[0] == 0 &&
                       offsets.data()[contours] == static_cast<std::int64_t>(count),
                   "offsets must run from 0 to the number of points, one more than the degrees");
    for (std::size_t c = 0; c < contours; ++c) {
        const std::int64_t degree = degrees.data()[c], size = offsets.data()[c + 1] - offsets.data()[c];
        ffseg::require(degree >= 1 && degree <= ffseg::raster::kMaxDegree && size >= degree && size % degree == 0,
                       "a contour needs N * d control points, N >= 1, d from 1 to 6");
    }
}

// Edges of closed contours on the grid.
std::vector<ffseg::raster::Edge> edges_of(const std::vector<ffseg::Vec2>& control, const Indices& offsets,
                                          const Indices& degrees, const ffseg::raster::PixelGrid& grid) {
    std::vector<ffseg::raster::Edge> edges;
    edges.reserve(2 * control.size());  // what mostly is enough
    for (std::size_t c = 0; c < degrees.shape(0); ++c) {
        const std::size_t begin = static_cast<std::size_t>(offsets.data()[c]);
        const std::size_t end = static_cast<std::size_t>(offsets.data()[c + 1]);
        ffseg::raster::append_contour(control.data() + begin, end - begin, static_cast<int>(degrees.data()[c]), grid,
                                      edges);
    }
    return edges;
}

std::vector<ffseg::Vec2> checked_contours(const Points& points, const Indices& offsets, const Indices& degrees,
                                          double tolerance) {
    ffseg::require(tolerance >= 1e-6, "the tolerance must be at least 1e-6 pixel");
    std::vector<ffseg::Vec2> control = ffseg::points_of(points, kMaxCoordinate);
    check_contours(offsets, degrees, control.size());
    return control;
}

void py_rasterize(const Points& points, const Indices& offsets, const Indices& degrees, double tolerance, Mask out) {
    ffseg::require(out.shape(0) <= 65535 && out.shape(1) <= 65535, "the mask exceeds 65535 pixels a side");
    const std::vector<ffseg::Vec2> control = checked_contours(points, offsets, degrees, tolerance);
    const ffseg::raster::MaskView mask{out.data(), static_cast<int>(out.shape(0)), static_cast<int>(out.shape(1))};
    nb::gil_scoped_release release;
    ffseg::raster::fill_mask(edges_of(control, offsets, degrees, {mask.width - 1.0, mask.height - 1.0, tolerance}),
                             mask);
}

auto py_crossings(const Points& steps, const Points& points, const Indices& offsets, const Indices& degrees,
                  double tolerance) {
    std::vector<ffseg::Vec2> moved = ffseg::points_of(steps, 65536.0);
    std::vector<ffseg::Vec2> control = checked_contours(points, offsets, degrees, tolerance);
    {
        nb::gil_scoped_release release;
        ffseg::Box box;
        for (const ffseg::Vec2 step : moved) box.add(step);
        ffseg::raster::PixelGrid grid{box.x1 + 0.5, box.y1 + 0.5, tolerance, -1.0};
        for (int axis = 0; axis < 2; ++axis, std::swap(grid.right, grid.bottom)) {
            ffseg::raster::move_to_crossings(edges_of(control, offsets, degrees, grid), moved);
            for (ffseg::Vec2& p : moved) std::swap(p.x, p.y);
            for (ffseg::Vec2& p : control) std::swap(p.x, p.y);
        }
    }
    return ffseg::given_points(moved);
}

// Calls measure(first point, count) for each contour.
template <class Measure>
std::vector<double> of_each(const Points& points, const Indices& offsets, const Measure& measure) {
    const std::vector<ffseg::Vec2> control = ffseg::points_of(points);
    const std::vector<std::size_t> ends = ffseg::ends_of(offsets, control.size());
    std::vector<double> found;
    for (std::size_t c = 1; c < ends.size(); ++c) {
        found.push_back(measure(control.data() + ends[c - 1], ends[c] - ends[c - 1]));
    }
    return found;
}

std::vector<double> py_signed_areas(const Points& points, const Indices& offsets,
                                    const ffseg::Array<const double, nb::ndim<2>>& matrix) {
    const std::size_t degree = matrix.shape(0) - 1;
    ffseg::require(degree >= 1 && degree <= ffseg::raster::kMaxDegree && matrix.shape(1) == degree + 1,
                   "the matrix of an area has degree + 1 rows and columns");
    return of_each(points, offsets, [&](const ffseg::Vec2* first, std::size_t count) {
        ffseg::require(count > 0 && count % degree == 0, "a contour needs N * d control points");
        return ffseg::signed_area(first, count, matrix.data(), degree);
    });
}

std::vector<double> py_steps_along_axes(const Points& points, const Indices& offsets) {
    return of_each(points, offsets, ffseg::steps_along_axes);
}

}  // namespace

void bind_raster(nb::module_& m) {
    m.def("rasterize", &py_rasterize, "points"_a, "offsets"_a, "degrees"_a, "tolerance"_a, "out"_a,
          "Region (winding > 0) of closed contours at the pixel centres, 1 or 0 into `out`.");
    m.def("crossings", &py_crossings, "steps"_a, "points"_a, "offsets"_a, "degrees"_a, "tolerance"_a,
          "Steps between pixel centres, by their middles, moved to where closed contours cross them.");
    m.def("signed_areas", &py_signed_areas, "points"_a, "offsets"_a, "matrix"_a,
          "Signed area of each contour; the matrix takes the coordinates of a patch to its part.");
    m.def("steps_along_axes", &py_steps_along_axes, "points"_a, "offsets"_a,
          "Length of each control polygon along the axes.");
}
