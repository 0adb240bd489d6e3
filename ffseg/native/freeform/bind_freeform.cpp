#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include <algorithm>
#include <limits>
#include <stdexcept>

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
    ffseg::freeform::ContourSet set{ffseg::points_of(points, std::numeric_limits<double>::max()), {}};
    set.offsets = ffseg::patch_ends_of(offsets, set.points.size(), degree);
    if (set.offsets.size() < 2) throw std::invalid_argument("an evolution needs a contour or more");
    return set;
}

void check(const ffseg::freeform::EvolutionOptions& o) {
    const bool sane = o.degree >= 1 && o.degree <= 6 && o.split_threshold >= 1 && o.split_threshold <= 1e6 &&
                      o.balloon > 0 && o.balloon <= 1e3 && o.max_iterations >= 0 && o.clearance >= 0 &&
                      o.clearance <= 1e4 && o.settle >= 0 && o.settle <= 16 && o.ridge_low >= 0 && o.weight >= 0 &&
                      o.weight <= 1e3 && o.window >= 0 && o.window <= 1e5;
    if (!sane) throw std::invalid_argument("an evolution option is out of range");
}

constexpr std::int32_t kMostCells = 4096;  // a side of a plane: 2 MB as bits

// Holds the evolution, and the image it goes on looking at: edge map and domain are read while it is made.
struct PyEvolution {
    std::optional<Colours> image;
    std::unique_ptr<ffseg::freeform::Evolution> evolution;
    std::size_t height, width;

    PyEvolution(const Points& points, const Indices& offsets, const Bytes& edges, std::optional<Bytes> domain,
                ffseg::freeform::EvolutionOptions options, const std::optional<Colours>& given,
                const std::optional<Whole>& plane)
        : image(given), height(edges.shape(0)), width(edges.shape(1)) {
        check(options);
        if (height == 0 || width == 0 || height > 65535 || width > 65535) {
            throw std::invalid_argument("the edge map must have 1 to 65535 pixels a side");
        }
        if (domain && (domain->shape(0) != height || domain->shape(1) != width)) {
            throw std::invalid_argument("the domain differs in size from the edge map");
        }
        if (image && (image->shape(0) != height || image->shape(1) != width)) {
            throw std::invalid_argument("the image differs in size from the edge map");
        }
        if (plane) options.plane = plane_of(*plane);
        const ffseg::Picture colours = image ? ffseg::picture_of(*image) : ffseg::Picture{};
        const ffseg::freeform::ContourSet starts = contour_set(points, offsets, options.degree);
        const std::uint8_t* limits = domain ? domain->data() : nullptr;
        nb::gil_scoped_release release;
        evolution = ffseg::freeform::make_evolution(starts, edges.data(), limits, static_cast<int>(height),
                                                    static_cast<int>(width), options, colours);
    }

    bool advance(int iterations) {
        nb::gil_scoped_release release;
        return evolution->advance(iterations);
    }

    ffseg::freeform::Plane plane_of(const Whole& cells) const {
        if (cells.shape(0) != height || cells.shape(1) != width) {
            throw std::invalid_argument("the plane differs in size from the edge map");
        }
        std::int32_t last = 0;
        for (std::size_t at = 0; at < height * width; ++at) {
            const std::int32_t cell = cells.data()[at];
            if (cell >= 0) last = std::max({last, cell >> 16, cell & 0xffff});
        }
        if (last >= kMostCells) throw std::invalid_argument("the plane has more than 4096 cells a side");
        return {cells.data(), last + 1};
    }

    void settle(const Words& gradient) {
        if (gradient.shape(0) != height || gradient.shape(1) != width) {
            throw std::invalid_argument("the gradient differs in size from the edge map");
        }
        nb::gil_scoped_release release;
        evolution->settle({gradient.data(), static_cast<int>(height), static_cast<int>(width)});
    }

    nb::tuple contours() const {
        const ffseg::freeform::ContourSet set = evolution->contours();
        return ffseg::given_contours(set.points, set.offsets);
    }

    const char* stop_reason() const {
        switch (evolution->stop_reason()) {
            case ffseg::freeform::StopReason::kConverged: return "converged";
            case ffseg::freeform::StopReason::kMaxIterations: return "max_iterations";
            case ffseg::freeform::StopReason::kMaxPatches: return "max_patches";
            case ffseg::freeform::StopReason::kBudget: return "budget";
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
        .def(nb::init<const Points&, const Indices&, const Bytes&, std::optional<Bytes>, const Options&,
                      const std::optional<Colours>&, const std::optional<Whole>&>(),
             "points"_a, "offsets"_a, "edges"_a, "domain"_a.none(), "options"_a, "image"_a.none() = nb::none(),
             "plane"_a.none() = nb::none())
        .def("advance", &PyEvolution::advance, "iterations"_a, "Runs iterations; False once the contour has stopped.")
        .def("settle", &PyEvolution::settle, "gradient"_a, "Attracts the contour to the ridge of the gradient.")
        .def("contours", &PyEvolution::contours, "Control points (M, 2) of all contours and their offsets.")
        .def("counts", &PyEvolution::counts)
        .def_prop_ro("stop_reason", &PyEvolution::stop_reason);
}
