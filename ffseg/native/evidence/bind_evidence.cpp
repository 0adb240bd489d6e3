#include <nanobind/stl/vector.h>

#include <cmath>

#include "bindings.hpp"
#include "common/arrays.hpp"
#include "evidence/blur.hpp"
#include "evidence/elementary.hpp"
#include "evidence/flood.hpp"
#include "evidence/forest.hpp"
#include "evidence/lab.hpp"
#include "evidence/level.hpp"
#include "evidence/relative.hpp"
#include "evidence/texture.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

namespace evidence = ffseg::evidence;
using ffseg::Bytes;
using ffseg::check_size;
using ffseg::require;
using ffseg::Size;
using ffseg::size_of;

using Pixels = ffseg::Array<const std::uint8_t>;
using InPlane = ffseg::Array<const float, nb::ndim<2>>;
using InPlanes = ffseg::Array<const float, nb::ndim<3>>;
using OutPlane = ffseg::Array<float, nb::ndim<2>>;
using OutPlanes = ffseg::Array<float, nb::ndim<3>>;
using OutWhole = ffseg::Array<std::uint16_t, nb::ndim<2>>;
using OutBytes = ffseg::Array<std::uint8_t, nb::ndim<2>>;
using Whole = ffseg::Array<const std::int32_t, nb::ndim<1>>;
using Real = ffseg::Array<const float, nb::ndim<1>>;

// Of planes that are flooded, pixels a side: costs of the longest shortest path stay below 2^32.
constexpr std::size_t kMaxFlooded = 4096;

// The size of so many planes.
template <class Planes>
Size check_planes(const Planes& planes, std::size_t count) {
    require(planes.shape(0) == count, "there are more or fewer planes than this needs");
    const std::size_t height = planes.shape(1), width = planes.shape(2);
    require(height > 0 && width > 0 && height <= ffseg::kMaxSide && width <= ffseg::kMaxSide,
            "the planes must have 1 to 65535 pixels a side");
    return {static_cast<int>(height), static_cast<int>(width)};
}

// Planes of the same size, so many.
template <class Planes>
void check_planes(const Planes& planes, std::size_t count, Size size) {
    const Size found = check_planes(planes, count);
    require(found.height == size.height && found.width == size.width, "the arrays differ in size");
}

void check_step(double step) { require(step >= 1e-6 && step <= 1e6, "the step is out of range"); }

void py_lab(const Pixels& image, int factor, OutPlanes out) {
    const ffseg::Picture picture = ffseg::picture_of(image, 4);
    require(picture.channels != 2, "the image must have 1, 3 or 4 channels");
    require(factor >= 1 && factor <= 256, "the factor is out of range");
    check_planes(out, 3, evidence::reduced(picture, factor));
    nb::gil_scoped_release release;
    evidence::reduced_lab(picture, factor, out.data());
}

void py_thin(const std::vector<InPlane>& planes, OutPlanes out) {
    require(!planes.empty(), "there is no plane");
    const Size size = size_of(planes[0]);
    for (const InPlane& plane : planes) check_size(plane, size);
    check_planes(out, planes.size(), evidence::halved(size));
    std::vector<const float*> values;
    for (const InPlane& plane : planes) values.push_back(plane.data());
    float* to = out.data();
    nb::gil_scoped_release release;
    for (const float* plane : values) {
        evidence::thin(plane, size, to);
        to += evidence::halved(size).count();
    }
}

void py_steepest(const InPlane& plane, OutPlane out) {
    const Size size = size_of(plane);
    check_size(out, evidence::halved(size));
    nb::gil_scoped_release release;
    evidence::steepest(plane.data(), size, out.data());
}

// A function of each value.
template <void (*function)(const float*, std::size_t, float*)>
void py_elementary(const InPlane& values, OutPlane out) {
    const Size size = size_of(values);
    check_size(out, size);
    nb::gil_scoped_release release;
    function(values.data(), size.count(), out.data());
}

void py_enlarge(const InPlane& plane, int factor, int stride, OutPlane out) {
    const Size size = size_of(plane), whole = size_of(out);
    require(factor >= 1 && factor <= 65535 && stride >= 1 && stride <= 65535, "the factor is out of range");
    nb::gil_scoped_release release;
    evidence::enlarge(plane.data(), size, {whole, factor, stride}, out.data());
}

void py_blur(const InPlane& plane, double sigma, OutPlane out) {
    const Size size = size_of(plane);
    check_size(out, size);
    require(sigma > 0 && sigma <= evidence::kMaxBlur, "sigma is out of range");
    nb::gil_scoped_release release;
    evidence::blur(plane.data(), size, sigma, out.data());
}

template <auto look, int planes>
void py_look(const InPlanes& lab, double sigma, OutPlanes out) {
    const Size size = check_planes(lab, 3);
    check_planes(out, planes, size);
    require(sigma > 0 && 2 * sigma <= evidence::kMaxBlur, "sigma is out of range");
    nb::gil_scoped_release release;
    look(lab.data(), size, sigma, out.data());
}

void py_relative(const InPlanes& lab, const Bytes& inside, double floor, const InPlanes& some, OutPlanes out) {
    const Size size = check_planes(lab, 3), few = check_planes(some, 3);
    check_planes(out, evidence::kRelativePlanes, few);
    check_size(inside, size);
    require(floor > 0 && std::isfinite(floor), "the floor is out of range");
    nb::gil_scoped_release release;
    evidence::relative_colour(lab.data(), inside.data(), size, floor, {some.data(), few.count()}, out.data());
}

// The region of a binned colour may not be asked of NaN.
void check_finite(const float* values, std::size_t count) {
    require(evidence::within(values, count, 1e6F), "a value is not finite or beyond 1e6");
}

void py_likelihood(const InPlanes& lab, const Bytes& inside, OutPlane out) {
    const Size size = check_planes(lab, 3);
    check_size(inside, size);
    check_size(out, size);
    check_finite(lab.data(), 3 * size.count());
    nb::gil_scoped_release release;
    evidence::likelihood_ratio(lab.data(), inside.data(), size, out.data());
}

void py_diffuse(const InPlane& values, const InPlanes& lab, double kept, double contrast, int steps, OutPlane out) {
    const Size size = size_of(values);
    check_planes(lab, 3, size);
    check_size(out, size);
    require(kept >= 1e-6 && kept <= 1e6, "the weight is out of range");
    require(contrast >= 1e-3 && contrast <= 1e6, "the contrast is out of range");
    require(steps >= 0 && steps <= 10000, "the number of steps is out of range");
    nb::gil_scoped_release release;
    evidence::diffuse(values.data(), lab.data(), size, {kept, contrast, steps}, out.data());
}

void py_barrier(const InPlane& heights, const Bytes& inside, double step, OutPlanes out) {
    const Size size = size_of(heights, kMaxFlooded);
    check_planes(out, evidence::kBarrierPlanes, size);
    check_size(inside, size);
    check_step(step);
    nb::gil_scoped_release release;
    evidence::barrier_planes(heights.data(), inside.data(), size, step, out.data());
}

void py_geodesic(const InPlane& heights, const Bytes& inside, double step, int least, OutPlane out) {
    const Size size = size_of(heights, kMaxFlooded);
    check_size(inside, size);
    check_size(out, size);
    check_step(step);
    require(least >= 1 && least <= 4095, "the least cost is out of range");
    nb::gil_scoped_release release;
    evidence::geodesic(heights.data(), inside.data(), size, step, least, out.data());
}

void py_level(const InPlane& above, float undecided, float snap, float width, float height, OutWhole gradient,
              OutBytes edges) {
    const Size size = size_of(above);
    check_size(gradient, size);
    check_size(edges, size);
    check_finite(above.data(), size.count());
    require(snap > 0 && width > 0 && snap < 1e6F && width < 1e6F, "a width is out of range");
    require(height >= 0 && height <= 65535, "the height is out of range");
    nb::gil_scoped_release release;
    evidence::level_edges(above.data(), size, {undecided, snap, width, height}, gradient.data(), edges.data());
}

void make_forest(evidence::Forest* self, const Whole& feature, const Real& threshold, const Whole& left,
                 const Whole& right, const Whole& root, const Real& value, int features) {
    const std::size_t nodes = feature.shape(0);
    require(threshold.shape(0) == nodes && left.shape(0) == nodes && right.shape(0) == nodes,
            "the arrays of the nodes differ in size");
    require(features >= 1 && features <= 4096, "the number of features is out of range");
    const evidence::ForestArrays arrays{feature.data(), threshold.data(), left.data(),  right.data(),  nodes,
                                        root.data(),    root.shape(0),    value.data(), value.shape(0)};
    new (self) evidence::Forest(arrays, features);
}

void py_score(const evidence::Forest& forest, const InPlanes& planes, OutPlane out) {
    const Size size = check_planes(planes, static_cast<std::size_t>(forest.features()));
    check_size(out, size);
    nb::gil_scoped_release release;
    forest.score(planes.data(), size.count(), out.data());
}

}  // namespace

void bind_evidence(nb::module_& m) {
    m.def("evidence_lab", &py_lab, "image"_a, "factor"_a, "out"_a,
          "L, a, b of the means of blocks of `factor` x `factor` pixels.");
    m.def("evidence_thin", &py_thin, "planes"_a, "out"_a, "Every second pixel each way of these planes.");
    m.def("evidence_steepest", &py_steepest, "plane"_a, "out"_a, "The largest value of each 2 x 2 pixels.");
    m.def("evidence_enlarge", &py_enlarge, "plane"_a, "factor"_a, "stride"_a, "out"_a,
          "A plane whose values are `stride` blocks of `factor` pixels apart at each pixel, linear between them.");
    m.def("evidence_logarithm", &py_elementary<evidence::logarithms>, "values"_a, "out"_a,
          "Natural logarithms of positive values, the same on every processor.");
    m.def("evidence_exponential", &py_elementary<evidence::exponentials>, "values"_a, "out"_a,
          "Exponentials of values, no more than 87 either way, the same on every processor.");
    m.def("evidence_blur", &py_blur, "plane"_a, "sigma"_a, "out"_a, "Gaussian smoothing; outside, the border repeats.");
    m.def("evidence_texture", &py_look<evidence::texture, evidence::kTexturePlanes>, "lab"_a, "sigma"_a, "out"_a,
          "L, a, b smoothed; gradient of L, of a and b, of all; eigenvalues of the structure tensor of L.");
    m.def("evidence_colour", &py_look<evidence::colour, evidence::kColourPlanes>, "lab"_a, "sigma"_a, "out"_a,
          "L, a, b smoothed; gradient of all.");
    m.def("evidence_relative", &py_relative, "lab"_a, "inside"_a, "floor"_a, "some"_a, "out"_a,
          "L, a, b of some pixels less their means inside, and their length over deviation inside + floor.");
    m.def("evidence_likelihood", &py_likelihood, "lab"_a, "inside"_a, "out"_a,
          "Logarithm of how much likelier a pixel's colour is inside than in the whole plane.");
    m.def("evidence_diffuse", &py_diffuse, "values"_a, "lab"_a, "kept"_a, "contrast"_a, "steps"_a, "out"_a,
          "Smoothing that stops at edges: Jacobi's method for Grady's random walker with priors.");
    m.def("evidence_barrier", &py_barrier, "heights"_a, "inside"_a, "step"_a, "out"_a,
          "Least maximum of the heights on a way from inside; its logarithm over the median inside; shares of pixels "
          "at or "
          "below it, at it, and about at it.");
    m.def("evidence_geodesic", &py_geodesic, "heights"_a, "inside"_a, "step"_a, "least"_a, "out"_a,
          "Length of the cheapest way from inside, where a pixel costs its height + least, in steps.");
    m.def("evidence_level", &py_level, "above"_a, "undecided"_a, "snap"_a, "width"_a, "height"_a, "gradient"_a,
          "edges"_a,
          "Edges where a map crosses zero, in place: a ridge in the gradient, and the image's own where it is "
          "undecided.");
    nb::class_<evidence::Forest>(m, "EvidenceForest", "A boosted forest of trees with at most 32 leaves each.")
        .def("__init__", &make_forest, "feature"_a, "threshold"_a, "left"_a, "right"_a, "root"_a, "value"_a,
             "features"_a)
        .def_prop_ro("features", &evidence::Forest::features)
        .def_prop_ro("trees", [](const evidence::Forest& forest) { return forest.trees(); })
        .def("score", &py_score, "planes"_a, "out"_a, "Sum of the leaves that each pixel reaches.");
}
