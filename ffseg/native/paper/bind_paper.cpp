#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <cmath>

#include "bindings.hpp"
#include "common/arrays.hpp"
#include "paper/evolution.hpp"

namespace nb = nanobind;
using namespace nb::literals;
namespace paper = ffseg::paper;

namespace {

using ffseg::Bytes;
using ffseg::Indices;
using ffseg::Points;
using ffseg::Words;
using Index4 = std::vector<std::size_t>;

constexpr double kFar = 1e6;  // px

struct Options {
    int degree = 0, max_iterations = 0;
    std::size_t budget = 0;
    double split_threshold = 0, balloon = 0, exponent = 0, sigma = 0;
    bool refine = false, topology = false;
};

void check(const Options& o) {
    ffseg::require(o.degree >= 1 && o.degree <= paper::kMaxPatchDegree && o.split_threshold >= 1 &&
                       o.split_threshold <= 1e6 && std::abs(o.balloon) <= 1e3 && o.max_iterations >= 0 &&
                       o.exponent >= 1 && o.exponent <= 64 && o.sigma > 0 && o.sigma <= 1e3,
                   "an option of the paper's method is out of range");
}

paper::Contour contour_of(const Points& points, const Indices& offsets, const Options& o) {
    const int degree = o.degree;
    paper::Contour contour{paper::Basis(degree), {}, {}, {}, o.budget};
    const std::vector<ffseg::Vec2> control = ffseg::points_of(points, kFar);
    const std::vector<std::size_t> ends = ffseg::patch_ends_of(offsets, control.size(), degree);
    const auto step = static_cast<std::size_t>(degree);
    for (std::size_t c = 0; c + 1 < ends.size(); ++c) {
        const std::size_t size = ends[c + 1] - ends[c];
        paper::Component component(size / step);
        for (std::size_t i = 0; i < size / step; ++i) {
            for (std::size_t k = 0; k <= step; ++k) component[i][k] = control[ends[c] + (i * step + k) % size];
        }
        contour.components.push_back(component);
    }
    return contour;
}

// The paper's algorithm, in one go or step by step.
struct PyPaper {
    Options options;
    paper::Evolution evolution;

    PyPaper(const Points& points, const Indices& offsets, const Words& gradient, const Bytes& edges,
            const std::optional<Bytes>& domain, const Options& given)
        : options(given), evolution(made(points, offsets, gradient, edges, domain, given)) {}

    static paper::Evolution made(const Points& points, const Indices& offsets, const Words& gradient,
                                 const Bytes& edges, const std::optional<Bytes>& domain, const Options& o) {
        check(o);
        const ffseg::Size size = ffseg::size_of(gradient);
        ffseg::check_size(edges, size);
        paper::Field field(gradient.data(), edges.data(), ffseg::domain_of(domain, size), size.height, size.width);
        return {contour_of(points, offsets, o),
                std::move(field),
                {o.balloon, o.exponent, o.sigma},
                {o.split_threshold, o.refine, o.topology, o.max_iterations}};
    }

    bool advance(int iterations) {
        nb::gil_scoped_release release;
        return evolution.advance(iterations);
    }

    nb::tuple contours() {
        std::vector<ffseg::Vec2> points;
        std::vector<std::size_t> ends{0};
        const auto add = [&](const std::vector<paper::Component>& components) {
            for (const paper::Component& component : components) {
                for (const paper::Patch& patch : component) {
                    for (int k = 0; k < options.degree; ++k) points.push_back(patch[k]);
                }
                ends.push_back(points.size());
            }
        };
        add(evolution.contour().components);
        add(evolution.contour().inner);
        return ffseg::given_contours(points, ends);
    }

    nb::dict counts() {
        const paper::Counts& c = evolution.contour().counts;
        nb::dict out;
        out["iterations"] = c.iterations;
        out["splits"] = c.splits;
        out["prunes"] = c.prunes;
        out["flips"] = c.flips;
        out["merges"] = c.merges;
        out["reversals"] = c.reversals;
        out["comparisons"] = c.comparisons;
        out["box_tests"] = c.box_tests;
        out["polygon_tests"] = c.polygon_tests;
        out["evolving"] = evolution.contour().components.size();
        return out;
    }

    std::vector<Index4> meeting() {
        std::vector<Index4> found;
        for (const auto& [a, b] : paper::meeting(evolution.contour())) {
            found.push_back({a.component, a.patch, b.component, b.patch});
        }
        return found;
    }

    std::pair<std::size_t, std::size_t> step() {
        const paper::Moved result = evolution.step();
        return {result.moved, result.samples};
    }

    const char* stop_reason() const { return ffseg::name_of(evolution.stop()); }
};

}  // namespace

void bind_paper(nb::module_& m) {
    nb::class_<Options>(m, "PaperOptions")
        .def(nb::init<>())
        .def_rw("degree", &Options::degree)
        .def_rw("split_threshold", &Options::split_threshold)
        .def_rw("balloon", &Options::balloon)
        .def_rw("exponent", &Options::exponent)
        .def_rw("sigma", &Options::sigma)
        .def_rw("refine", &Options::refine)
        .def_rw("topology", &Options::topology)
        .def_rw("max_iterations", &Options::max_iterations)
        .def_rw("budget", &Options::budget);
    nb::class_<PyPaper>(m, "PaperEvolution")
        .def(nb::init<const Points&, const Indices&, const Words&, const Bytes&, const std::optional<Bytes>&,
                      const Options&>(),
             "points"_a, "offsets"_a, "gradient"_a, "edges"_a, "domain"_a.none(), "options"_a)
        .def("advance", &PyPaper::advance, "iterations"_a, "Runs iterations; False once the contour has stopped.")
        .def("step", &PyPaper::step, "One iteration of Algorithm 4: how many samples moved, of how many.")
        .def("split", [](PyPaper& p) { paper::split(p.evolution.contour(), p.options.split_threshold); })
        .def("prune", [](PyPaper& p) { paper::prune(p.evolution.contour(), p.options.split_threshold); })
        .def("flip", [](PyPaper& p) { paper::flip(p.evolution.contour()); })
        .def("meeting", &PyPaper::meeting, "Component and patch of both patches of each pair that passes the filter.")
        .def("contours", &PyPaper::contours,
             "Control points (M, 2) of all contours and their offsets; those set aside come last.")
        .def("counts", &PyPaper::counts)
        .def_prop_ro("stop_reason", &PyPaper::stop_reason);
}
