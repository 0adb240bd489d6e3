#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include <algorithm>

#include "bindings.hpp"
#include "common/arrays.hpp"
#include "freeform/evolution.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using ffseg::Bytes;
using ffseg::Colours;
using ffseg::Indices;
using ffseg::Points;
using ffseg::Whole;
using ffseg::Words;

ffseg::freeform::ContourSet contour_set(const Points& points, const Indices& offsets, int degree) {
    ffseg::freeform::ContourSet set{ffseg::points_of(points), {}};
    set.offsets = ffseg::patch_ends_of(offsets, set.points.size(), degree);
    ffseg::require(set.offsets.size() > 1, "an evolution needs a contour or more");
    return set;
}

void check(const ffseg::freeform::EvolutionOptions& o) {
    ffseg::require(o.degree >= 1 && o.degree <= 6 && o.split_threshold >= 1 && o.split_threshold <= 1e6 &&
                       o.balloon > 0 && o.balloon <= 1e3 && o.max_iterations >= 0 && o.clearance >= 0 &&
                       o.clearance <= 1e4 && o.settle >= 0 && o.settle <= 16 && o.ridge_low >= 0 && o.weight >= 0 &&
                       o.weight <= 1e3 && o.window >= 0 && o.window <= 1e5,
                   "an evolution option is out of range");
}

constexpr std::int32_t kMaxCells = 4096;  // a side of a plane: 2 MB as bits

// Holds the evolution, and the image it goes on looking at: edge map and domain are read while it is made.
struct PyEvolution {
    std::optional<Colours> image;
    std::unique_ptr<ffseg::freeform::Evolution> evolution;
    ffseg::Size size;

    PyEvolution(const Points& points, const Indices& offsets, const Bytes& edges, const std::optional<Bytes>& domain,
                ffseg::freeform::EvolutionOptions options, const std::optional<Colours>& given,
                const std::optional<Whole>& plane)
        : image(given), size(ffseg::size_of(edges)) {
        check(options);
        const std::uint8_t* const limits = ffseg::domain_of(domain, size);
        if (image) ffseg::check_size(*image, size);
        if (plane) options.plane = plane_of(*plane);
        const ffseg::Picture colours = image ? ffseg::picture_of(*image) : ffseg::Picture{};
        const ffseg::freeform::ContourSet starts = contour_set(points, offsets, options.degree);
        nb::gil_scoped_release release;
        evolution =
            ffseg::freeform::make_evolution(starts, edges.data(), limits, size.height, size.width, options, colours);
    }

    bool advance(int iterations) {
        nb::gil_scoped_release release;
        return evolution->advance(iterations);
    }

    ffseg::freeform::Plane plane_of(const Whole& cells) const {
        ffseg::check_size(cells, size);
        std::int32_t last = 0;
        for (std::size_t at = 0; at < size.count(); ++at) {
            const std::int32_t cell = cells.data()[at];
            if (cell >= 0) last = std::max({last, cell >> 16, cell & 0xffff});
        }
        ffseg::require(last < kMaxCells, "the plane has more than 4096 cells a side");
        return {cells.data(), last + 1};
    }

    void settle(const Words& gradient) {
        ffseg::check_size(gradient, size);
        nb::gil_scoped_release release;
        evolution->settle({gradient.data(), size.height, size.width});
    }

    nb::tuple contours() const {
        const ffseg::freeform::ContourSet set = evolution->contours();
        return ffseg::given_contours(set.points, set.offsets);
    }

    const char* stop_reason() const { return ffseg::name_of(evolution->stop_reason()); }

    nb::dict counts() const {
        const ffseg::freeform::EvolutionCounts& c = evolution->counts();
        nb::dict out;
        out["iterations"] = c.iterations;
        out["splits"] = c.splits;
        out["prunes"] = c.prunes;
        out["flips"] = c.flips;
        out["merges"] = c.merges;
        out["drops"] = c.drops;
        out["work"] = evolution->work();
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
        .def_rw("budget", &Options::budget)
        .def_rw("clearance", &Options::clearance)
        .def_rw("settle", &Options::settle)
        .def_rw("ridge_low", &Options::ridge_low)
        .def_rw("weight", &Options::weight)
        .def_rw("window", &Options::window);
    nb::class_<PyEvolution>(m, "Evolution")
        .def(nb::init<const Points&, const Indices&, const Bytes&, const std::optional<Bytes>&, const Options&,
                      const std::optional<Colours>&, const std::optional<Whole>&>(),
             "points"_a, "offsets"_a, "edges"_a, "domain"_a.none(), "options"_a, "image"_a.none() = nb::none(),
             "plane"_a.none() = nb::none())
        .def("advance", &PyEvolution::advance, "iterations"_a, "Runs iterations; False once the contour has stopped.")
        .def("settle", &PyEvolution::settle, "gradient"_a, "Attracts the contour to the ridge of the gradient.")
        .def("contours", &PyEvolution::contours, "Control points (M, 2) of all contours and their offsets.")
        .def("counts", &PyEvolution::counts)
        .def_prop_ro("stop_reason", &PyEvolution::stop_reason);
}
