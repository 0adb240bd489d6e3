#include <nanobind/stl/string.h>

#include <cmath>
#include <stdexcept>

#include "bindings.hpp"
#include "text/path_text.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Points = nb::ndarray<const double, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;

std::string py_path_text(const Points& points, int degree) {
    if (degree < 1 || degree > 3) throw std::invalid_argument("a path is written in degree 1, 2 or 3");
    if (points.shape(0) == 0 || points.shape(0) % static_cast<std::size_t>(degree) != 0) {
        throw std::invalid_argument("a closed contour needs N * degree control points, N >= 1");
    }
    std::vector<ffseg::Vec2> checked(points.shape(0));
    for (std::size_t i = 0; i < checked.size(); ++i) {
        checked[i] = {points.data()[2 * i], points.data()[2 * i + 1]};
        if (!(std::abs(checked[i].x) <= ffseg::text::kLargestWritten &&
              std::abs(checked[i].y) <= ffseg::text::kLargestWritten)) {
            throw std::invalid_argument("a coordinate is not finite or beyond 1e11 pixels");
        }
    }
    nb::gil_scoped_release release;
    return ffseg::text::path_text(checked, degree);
}

}  // namespace

void bind_text(nb::module_& m) {
    m.def("path_text", &py_path_text, "points"_a, "degree"_a,
          "SVG path of one closed contour: M, L or Q or C, Z, four digits behind the point at most.");
}
