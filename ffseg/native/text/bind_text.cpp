#include <nanobind/stl/string.h>

#include "bindings.hpp"
#include "common/arrays.hpp"
#include "text/path_text.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using ffseg::Points;

std::string py_path_text(const Points& points, int degree) {
    ffseg::require(degree >= 1 && degree <= 3, "a path is written in degree 1, 2 or 3");
    ffseg::require(points.shape(0) > 0 && points.shape(0) % static_cast<std::size_t>(degree) == 0,
                   "a closed contour needs N * degree control points, N >= 1");
    const std::vector<ffseg::Vec2> checked = ffseg::points_of(points, ffseg::text::kMaxWritten);
    nb::gil_scoped_release release;
    return ffseg::text::path_text(checked, degree);
}

}  // namespace

void bind_text(nb::module_& m) {
    m.def("path_text", &py_path_text, "points"_a, "degree"_a,
          "SVG path of one closed contour: M, L or Q or C, Z, four digits behind the point at most.");
}
