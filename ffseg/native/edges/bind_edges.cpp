#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "common/arrays.hpp"
#include "edges/boundary.hpp"
#include "edges/canny.hpp"
#include "edges/enlarged.hpp"
#include "edges/gradient.hpp"
#include "edges/noise.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using ffseg::Bytes;
using ffseg::Size;
using ffseg::Words;
using Pixels = ffseg::Array<const std::uint8_t>;
using Plane8 = ffseg::Array<std::uint8_t, nb::ndim<2>>;
using Plane16 = ffseg::Array<std::uint16_t, nb::ndim<2>>;
using Floats = ffseg::Array<const float, nb::ndim<2>>;

nb::ndarray<nb::numpy, float> py_liveliest(const nb::ndarray<const std::uint8_t, nb::ndim<2>, nb::device::cpu>& plane,
                                           std::size_t most, std::size_t step, std::size_t skip) {
    ffseg::require(step > 0 && skip > 0, "steps must be 1 or more");
    return ffseg::given(ffseg::edges::liveliest(
        {plane.data(), plane.shape(0), plane.shape(1), plane.stride(0), plane.stride(1)}, most, step, skip));
}

std::vector<double> py_amiss(const Floats& lines, const Floats& rest, std::size_t factor, float rounded, double most) {
    const std::size_t size = rest.shape(0);
    ffseg::require(size > 0 && factor > 0 && rest.shape(1) % size == 0, "no such matrix");
    return ffseg::edges::amiss(lines.data(), lines.shape(0), lines.shape(1),
                               {rest.data(), size, rest.shape(1) / size, factor}, rounded, most);
}

void py_gradient(const Pixels& image, double sigma, Plane16 gradient, Plane8 ridges) {
    const ffseg::Picture pixels = ffseg::picture_of(image, 4);
    ffseg::check_size(gradient, {pixels.height, pixels.width});
    ffseg::check_size(ridges, {pixels.height, pixels.width});
    ffseg::require(sigma > 0 && sigma <= ffseg::edges::kMaxSigma, "sigma is out of range");
    nb::gil_scoped_release release;
    ffseg::edges::gradient_and_ridges(pixels, ffseg::edges::gaussian(sigma), gradient.data(), ridges.data());
}

// Thresholds from the noise: high = factor * local noise, at least `least`; low = low_ratio * high. The local noise is
// held within `spread` times that of the quiet windows either way. Returns the latter.
int py_canny_auto(const Words& gradient, const std::optional<Bytes>& domain, double factor, double least,
                  double low_ratio, double spread, Plane8 edges) {
    const Size size = ffseg::size_of(gradient);
    ffseg::check_size(edges, size);
    const std::uint8_t* const inside = ffseg::domain_of(domain, size);
    const bool finite = std::isfinite(factor) && std::isfinite(least) && std::isfinite(spread);
    ffseg::require(finite && factor >= 0 && least >= 0 && low_ratio >= 0 && low_ratio <= 1 && spread >= 1,
                   "a threshold option is out of range");
    nb::gil_scoped_release release;
    const ffseg::edges::NoiseMap noise = ffseg::edges::noise_map(gradient.data(), inside, size.height, size.width);
    ffseg::edges::ThresholdMap thresholds;
    thresholds.columns = noise.columns;
    for (const std::uint16_t block : noise.blocks) {
        const double local = std::clamp<double>(block, noise.quiet / spread, noise.quiet * spread);
        const double high = std::min(std::max(factor * local, least), 65535.0);
        thresholds.high.push_back(static_cast<std::uint16_t>(std::lround(high)));
        thresholds.low.push_back(static_cast<std::uint16_t>(std::lround(low_ratio * high)));
    }
    ffseg::edges::link_edges(gradient.data(), size.height, size.width, thresholds, edges.data());
    return noise.quiet;
}

void py_canny(const Words& gradient, int low, int high, Plane8 edges) {
    const Size size = ffseg::size_of(gradient);
    ffseg::check_size(edges, size);
    ffseg::require(low <= high, "the low threshold is above the high one");
    const auto clamp = [](int value) { return static_cast<std::uint16_t>(std::clamp(value, 0, 65535)); };
    nb::gil_scoped_release release;
    constexpr int kBlock = ffseg::edges::NoiseMap::kBlock;
    ffseg::edges::ThresholdMap thresholds;
    thresholds.columns = (size.width + kBlock - 1) / kBlock;
    const std::size_t rows = static_cast<std::size_t>((size.height + kBlock - 1) / kBlock);
    thresholds.low.assign(rows * static_cast<std::size_t>(thresholds.columns), clamp(low));
    thresholds.high.assign(thresholds.low.size(), clamp(high));
    ffseg::edges::link_edges(gradient.data(), size.height, size.width, thresholds, edges.data());
}

ffseg::edges::Limits limits_of(Size size, const std::optional<Bytes>& domain, int margin) {
    ffseg::require(margin >= 1 && margin <= 65535, "the margin must be 1 or more");
    return {ffseg::domain_of(domain, size), size.height, size.width, margin};
}

nb::ndarray<nb::numpy, std::uint16_t> py_gradients_at(const ffseg::Points& joints, const Words& gradient,
                                                      const std::optional<Bytes>& domain, int margin) {
    const ffseg::edges::Limits limits = limits_of(ffseg::size_of(gradient), domain, margin);
    return ffseg::given(ffseg::edges::gradients_at(ffseg::points_of(joints), gradient.data(), limits));
}

double py_share_within(const ffseg::Points& joints, const ffseg::Indices& ends, std::pair<int, int> shape,
                       const std::optional<Bytes>& domain, int margin) {
    const auto [height, width] = shape;
    ffseg::require(height > 0 && width > 0, "the image must have 1 pixel a side or more");
    const std::vector<ffseg::Vec2> points = ffseg::points_of(joints);
    return ffseg::edges::share_within(points, ffseg::ends_of(ends, points.size()),
                                      limits_of({height, width}, domain, margin));
}

double py_lively(const Bytes& region, const Words& gradient, const ffseg::Array<const double, nb::ndim<1>>& levels,
                 int step, double most) {
    const ffseg::Size size = ffseg::size_of(region);
    ffseg::check_size(gradient, size);
    const bool given = levels.shape(0) > 1 && levels.data()[levels.shape(0) - 1] >= 0;
    ffseg::require(given && step > 0, "two levels or more, the last at least 0, and a step of 1 or more");
    return ffseg::edges::lively_share(region.data(), gradient.data(), size,
                                      {levels.data(), levels.shape(0), step, most});
}

}  // namespace

void bind_edges(nb::module_& m) {
    m.def("liveliest_lines", &py_liveliest, "plane"_a, "most"_a, "step"_a, "skip"_a,
          "Of every `step`-th line the `most` that change most between every `skip`-th pixels, one after the other.");
    m.def("lines_amiss", &py_amiss, "lines"_a, "rest"_a, "factor"_a, "rounded"_a, "most"_a,
          "The share of pixels in lines that each kind of interpolation cannot make, exact only where one is at most "
          "`most`.");
    m.def(
        "gradient_and_ridges", &py_gradient, "image"_a, "sigma"_a, "gradient"_a, "ridges"_a,
        "Gradient magnitude of the strongest channel of the smoothed image, in 1/32 grey level per pixel, and 1 on its "
        "ridges (0 elsewhere).");
    m.def("canny_auto", &py_canny_auto, "gradient"_a, "domain"_a.none(), "factor"_a, "least"_a, "low_ratio"_a,
          "spread"_a, "edges"_a,
          "Canny edges (255) from the ridges in `edges`, in place, with thresholds from the local noise; returns the "
          "noise "
          "of quiet windows. Stored units.");
    m.def("canny", &py_canny, "gradient"_a, "low"_a, "high"_a, "edges"_a,
          "Canny edges (255) from the ridges in `edges`, in place, by hysteresis; thresholds in stored units.");
    m.def("gradients_at", &py_gradients_at, "joints"_a, "gradient"_a, "domain"_a.none(), "margin"_a,
          "The largest of nine gradients at each joint not within `margin` px of the border of image or domain.");
    m.def("lively_share", &py_lively, "region"_a, "gradient"_a, "levels"_a, "step"_a, "most"_a,
          "Part of a region, on every `step`-th row, with gradients above the level for the squared distance to the "
          "nearest pixel outside; the last holds farther inside, and nothing at distance 1. 1 if more than `most`.");
    m.def("share_within", &py_share_within, "joints"_a, "ends"_a, "shape"_a, "domain"_a.none(), "margin"_a,
          "Part of the polygons' length within `margin` px of the border of the image or the domain.");
}
