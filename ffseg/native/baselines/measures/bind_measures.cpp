#include <cmath>
#include <stdexcept>

#include "baselines/measures/nearest.hpp"
#include "bindings.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Points = nb::ndarray<const double, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;

constexpr double kFar = 1e9;  // beyond it cell numbers do not fit an int

std::vector<ffseg::Vec2> checked(const Points& points) {
    std::vector<ffseg::Vec2> out;
    out.reserve(points.shape(0));
    for (std::size_t i = 0; i < points.shape(0); ++i) {
        const double x = points.data()[2 * i], y = points.data()[2 * i + 1];
        if (!(std::abs(x) <= kFar && std::abs(y) <= kFar))
            throw std::invalid_argument("a point is not finite or far away");
        out.push_back({x, y});
    }
    return out;
}

nb::ndarray<nb::numpy, double> py_nearest(const Points& points, const Points& others) {
    const std::vector<ffseg::Vec2> from = checked(points), to = checked(others);
    auto* kept = new std::vector<double>();
    nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
    {
        nb::gil_scoped_release release;
        *kept = ffseg::measures::nearest_distances(from, to);
    }
    return nb::ndarray<nb::numpy, double>(kept->data(), {kept->size()}, owner);
}

}  // namespace

void bind_measures(nb::module_& m) {
    m.def("nearest_distances", &py_nearest, "points"_a, "others"_a,
          "Distance of each point to the nearest of the others; infinite without others.");
}
