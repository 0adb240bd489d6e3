#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "bindings.hpp"
#include "common/arrays.hpp"
#include "region/pressure.hpp"
#include "region/sums.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Table = nb::ndarray<std::int64_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using ffseg::Colours;
using ffseg::Indices;
using ffseg::Points;
using ffseg::region::RowSums;
using ffseg::region::Spans;

constexpr double kFarthest = 1e100;  // beyond it, products in the exact side test would overflow
constexpr double kWidestBand = 1000.0;

void init(RowSums* self, const Colours& image, int bins) {
    const ffseg::Picture picture = ffseg::picture_of(image);
    if (bins < 0 || bins > 256 || std::pow(bins, picture.channels) > ffseg::region::kMostBins) {
        throw std::invalid_argument("the bins of all channels together must be at most 512");
    }
    new (self) RowSums(picture, bins);
}

std::vector<ffseg::raster::Edge> edges_of(const Points& points, const Indices& offsets, int degree,
                                          const ffseg::raster::PixelGrid& grid) {
    if (degree < 1 || degree > ffseg::raster::kMaxDegree) throw std::invalid_argument("the degree must be from 1 to 6");
    if (offsets.shape(0) < 1 || offsets.data()[0] != 0) throw std::invalid_argument("offsets must begin with 0");
    const std::size_t contours = offsets.shape(0) - 1;
    if (offsets.data()[contours] != static_cast<std::int64_t>(points.shape(0))) {
        throw std::invalid_argument("offsets must end with the number of points");
    }
    const std::vector<ffseg::Vec2> control = ffseg::points_of(points, kFarthest);
    std::vector<ffseg::raster::Edge> edges;
    for (std::size_t c = 0; c < contours; ++c) {
        const std::int64_t begin = offsets.data()[c], size = offsets.data()[c + 1] - begin;
        if (begin < 0 || size < degree || size % degree != 0 ||
            begin + size > static_cast<std::int64_t>(control.size())) {
            throw std::invalid_argument("a contour needs N * d control points, N >= 1");
        }
        ffseg::raster::append_contour(control.data() + begin, static_cast<std::size_t>(size), degree, grid, edges);
    }
    return edges;
}

// Rows of `out`: the region, what of it lies within `band` of the rest, what of the rest lies within `band` of it.
void measure(const RowSums& self, const Points& points, const Indices& offsets, int degree, double tolerance,
             double band, Table out) {
    if (!(tolerance >= 1e-6)) throw std::invalid_argument("the tolerance must be at least 1e-6 pixel");
    if (!(band >= 1.0 && band <= kWidestBand)) throw std::invalid_argument("the band must be from 1 to 1000 pixels");
    if (out.shape(0) != 3 || out.shape(1) != self.length()) throw std::invalid_argument("the table has another size");
    const int height = self.height(), width = self.width();
    const auto edges = edges_of(points, offsets, degree, {width - 1.0, height - 1.0, tolerance});
    nb::gil_scoped_release release;
    const Spans inside = ffseg::raster::fill_spans(edges, height, width);
    const Spans rest = ffseg::region::complement(inside, height, width);
    const Spans parts[3] = {inside, ffseg::region::near(rest, inside, band, height, width),
                            ffseg::region::near(inside, rest, band, height, width)};
    for (std::size_t i = 0; i < 3; ++i) {
        const ffseg::region::Totals totals = self.over(parts[i]);
        std::copy(totals.begin(), totals.end(), out.data() + i * out.shape(1));
    }
}

// The pressure by colour on its own, for tests: an evolution makes its own one.
struct PyPressure {
    Colours image;
    ffseg::region::Pressure pressure;

    PyPressure(const Colours& given, double weight, double window)
        : image(given), pressure(checked(given, weight, window), weight, window) {}

    static ffseg::Picture checked(const Colours& image, double weight, double window) {
        if (!(weight > 0 && weight <= 1e3 && window >= 0 && window <= 1e5)) {
            throw std::invalid_argument("the weight or the window is out of range");
        }
        return ffseg::picture_of(image);
    }

    void fit(const Points& points, const Indices& offsets, int degree, bool closes_in) {
        if (degree < 1 || degree > ffseg::raster::kMaxDegree) throw std::invalid_argument("the degree must be 1 to 6");
        const std::vector<ffseg::Vec2> control = ffseg::points_of(points, kFarthest);
        const std::vector<std::size_t> ends = ffseg::patch_ends_of(offsets, control.size(), degree);
        pressure.fit({control, ends, degree}, closes_in);
    }

    double at(double x, double y) const { return pressure.at({x, y}); }
};

}  // namespace

void bind_region(nb::module_& m) {
    nb::class_<RowSums>(m, "RowSums", "Sums of an image's colours along its rows.")
        .def("__init__", &init, "image"_a, "bins"_a)
        .def_prop_ro("length", &RowSums::length, "Sums of a set: pixels, channels, products, histogram.")
        .def("measure", &measure, "points"_a, "offsets"_a, "degree"_a, "tolerance"_a, "band"_a, "out"_a,
             "Sums over the region of closed contours, over its inner and over its outer band, into rows of `out`.");
    nb::class_<PyPressure>(m, "Pressure", "The balloon's pressure by colour.")
        .def(nb::init<const Colours&, double, double>(), "image"_a, "weight"_a, "window"_a)
        .def("fit", &PyPressure::fit, "points"_a, "offsets"_a, "degree"_a, "closes_in"_a)
        .def("at", &PyPressure::at, "x"_a, "y"_a, "The share of the full pressure there.");
}
