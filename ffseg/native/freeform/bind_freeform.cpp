#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include <stdexcept>

#include "bindings.hpp"
#include "freeform/evolution.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Points = nb::ndarray<const double, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using Offsets = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Plane8 = nb::ndarray<const std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Plane16 = nb::ndarray<const std::uint16_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

ffseg::freeform::ContourSet contour_set(const Points& points, const Offsets& offsets, int degree) {
    ffseg::freeform::ContourSet set;
    const std::size_t count = points.shape(0);
    for (std::size_t i = 0; i < count; ++i) {
        const double x = points.data()[2 * i], y = points.data()[2 * i + 1];
        if (!std::isfinite(x) || !std::isfinite(y)) throw std::invalid_argument("a control point is not finite");
        set.points.push_back({x, y});
    }
    if (offsets.shape(0) < 2 || offsets.data()[0] != 0) throw std::invalid_argument("offsets must begin with 0");
    for (std::size_t c = 1; c < offsets.shape(0); ++c) {
        const std::int64_t begin = offsets.data()[c - 1], end = offsets.data()[c];
        if (end - begin < 2 * degree || (end - begin) % degree != 0 || end > static_cast<std::int64_t>(count)) {
            throw std::invalid_argument("a contour needs two patches or more of `degree` control points each");
        }
        set.offsets.push_back(static_cast<std::size_t>(end));
    }
    return set;
}

void check(const ffseg::freeform::EvolutionOptions& o) {
    const bool sane = o.degree >= 1 && o.degree <= 6 && o.split_threshold >= 1 && o.split_threshold <= 1e6 &&
                      o.balloon > 0 && o.balloon <= 1e3 && o.max_iterations >= 0 && o.clearance >= 0 &&
                      o.clearance <= 1e4 && o.settle >= 0 && o.settle <= 16 && o.ridge_low >= 0;
    if (!sane) throw std::invalid_argument("an evolution option is out of range");
}

// Holds the evolution only: edge map and domain are read while it is made.
struct PyEvolution {
    std::unique_ptr<ffseg::freeform::Evolution> evolution;
    std::size_t height, width;

    PyEvolution(const Points& points, const Offsets& offsets, const Plane8& edges, std::optional<Plane8> domain,
                const ffseg::freeform::EvolutionOptions& options)
        : height(edges.shape(0)), width(edges.shape(1)) {
        check(options);
        if (height == 0 || width == 0 || height > 65535 || width > 65535) {
            throw std::invalid_argument("the edge map must have 1 to 65535 pixels a side");
        }
        if (domain && (domain->shape(0) != height || domain->shape(1) != width)) {
            throw std::invalid_argument("the domain differs in size from the edge map");
        }
        const ffseg::freeform::ContourSet starts = contour_set(points, offsets, options.degree);
        const std::uint8_t* limits = domain ? domain->data() : nullptr;
        nb::gil_scoped_release release;
        evolution = ffseg::freeform::make_evolution(starts, edges.data(), limits, static_cast<int>(height),
                                          static_cast<int>(width), options);
    }

    bool advance(int iterations) {
        nb::gil_scoped_release release;
        return evolution->advance(iterations);
    }

    void settle(const Plane16& gradient) {
        if (gradient.shape(0) != height || gradient.shape(1) != width) {
            throw std::invalid_argument("the gradient differs in size from the edge map");
        }
        nb::gil_scoped_release release;
        evolution->settle({gradient.data(), static_cast<int>(height), static_cast<int>(width)});
    }

    nb::tuple contours() const {
        const ffseg::freeform::ContourSet set = evolution->contours();
        auto* points = new double[2 * set.points.size() + 1];
        nb::capsule owner(points, [](void* p) noexcept { delete[] static_cast<double*>(p); });
        for (std::size_t i = 0; i < set.points.size(); ++i) {
            points[2 * i] = set.points[i].x;
            points[2 * i + 1] = set.points[i].y;
        }
        nb::list offsets;
        for (const std::size_t offset : set.offsets) offsets.append(offset);
        return nb::make_tuple(nb::ndarray<nb::numpy, double>(points, {set.points.size(), 2}, owner), offsets);
    }

    const char* stop_reason() const {
        switch (evolution->stop_reason()) {
            case ffseg::freeform::StopReason::kConverged: return "converged";
            case ffseg::freeform::StopReason::kMaxIterations: return "max_iterations";
            case ffseg::freeform::StopReason::kMaxPatches: return "max_patches";
            case ffseg::freeform::StopReason::kVanished: return "vanished";
            case ffseg::freeform::StopReason::kBlocked: return "blocked";
            case ffseg::freeform::StopReason::kStalled: return "stalled";
            default: return "running";
        }
    }

    nb::dict counts() const {
        const ffseg::freeform::EvolutionCounts& c = evolution->counts();
        nb::dict out;
        out["iterations"] = c.iterations;
        out["splits"] = c.splits;
        out["prunes"] = c.prunes;
        out["flips"] = c.flips;
        out["merges"] = c.merges;
        out["drops"] = c.drops;
        return out;
    }
};

}  // namespace

void bind_freeform(nb::module_& m) {
    using Options = ffseg::freeform::EvolutionOptions;
    nb::class_<Options>(m, "EvolutionOptions")
        .def(nb::init<>())
        .def_rw("degree", &Options::degree)
        .def_rw("split_threshold", &Options::split_threshold)
        .def_rw("balloon", &Options::balloon)
        .def_rw("refine", &Options::refine)
        .def_rw("topology", &Options::topology)
        .def_rw("max_iterations", &Options::max_iterations)
        .def_rw("clearance", &Options::clearance)
        .def_rw("settle", &Options::settle)
        .def_rw("ridge_low", &Options::ridge_low);
    nb::class_<PyEvolution>(m, "Evolution")
        .def(nb::init<const Points&, const Offsets&, const Plane8&, std::optional<Plane8>, const Options&>(),
             "points"_a, "offsets"_a, "edges"_a, "domain"_a.none(), "options"_a)
        .def("advance", &PyEvolution::advance, "iterations"_a, "Runs iterations; False once the contour has stopped.")
        .def("settle", &PyEvolution::settle, "gradient"_a, "Attracts the contour to the ridge of the gradient.")
        .def("contours", &PyEvolution::contours, "Control points (M, 2) of all contours and their offsets.")
        .def("counts", &PyEvolution::counts)
        .def_prop_ro("stop_reason", &PyEvolution::stop_reason);
}
