#include "bindings.hpp"
#include "common/arrays.hpp"
#include "region/pressure.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using ffseg::Colours;
using ffseg::Indices;
using ffseg::Points;

constexpr double kMaxCoordinate = 1e100;  // beyond it, products in the exact side test would overflow

// The pressure by colour on its own, for tests: an evolution makes its own one.
struct PyPressure {
    Colours image;
    ffseg::region::Pressure pressure;

    PyPressure(const Colours& given, double weight, double window)
        : image(given), pressure(checked(given, weight, window), weight, window) {}

    static ffseg::Picture checked(const Colours& image, double weight, double window) {
        ffseg::require(weight > 0 && weight <= 1e3 && window >= 0 && window <= 1e5,
                       "the weight or the window is out of range");
        return ffseg::picture_of(image);
    }

    void fit(const Points& points, const Indices& offsets, int degree, bool closes_in) {
        ffseg::require(degree >= 1 && degree <= ffseg::raster::kMaxDegree, "the degree must be 1 to 6");
        const std::vector<ffseg::Vec2> control = ffseg::points_of(points, kMaxCoordinate);
        const std::vector<std::size_t> ends = ffseg::patch_ends_of(offsets, control.size(), degree);
        pressure.fit({control, ends, degree}, closes_in);
    }

    double at(double x, double y) const { return pressure.at({x, y}); }
};

}  // namespace

void bind_region(nb::module_& m) {
    nb::class_<PyPressure>(m, "Pressure", "The balloon's pressure by colour.")
        .def(nb::init<const Colours&, double, double>(), "image"_a, "weight"_a, "window"_a)
        .def("fit", &PyPressure::fit, "points"_a, "offsets"_a, "degree"_a, "closes_in"_a)
        .def("at", &PyPressure::at, "x"_a, "y"_a, "The share of the full pressure there.");
}
