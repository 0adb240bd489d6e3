#include "baselines/measures/nearest.hpp"
#include "bindings.hpp"
#include "common/arrays.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using ffseg::Points;

constexpr double kFar = 1e9;  // beyond it cell numbers do not fit an int

nb::ndarray<nb::numpy, double> py_nearest(const Points& points, const Points& others) {
    const std::vector<ffseg::Vec2> from = ffseg::points_of(points, kFar), to = ffseg::points_of(others, kFar);
    std::vector<double> distances;
    {
        nb::gil_scoped_release release;
        distances = ffseg::measures::nearest_distances(from, to);
    }
    return ffseg::given(std::move(distances));
}

}  // namespace

void bind_measures(nb::module_& m) {
    m.def("nearest_distances", &py_nearest, "points"_a, "others"_a,
          "Distance of each point to the nearest of the others; infinite without others.");
}
