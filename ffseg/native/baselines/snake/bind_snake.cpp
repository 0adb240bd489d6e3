#include <nanobind/stl/vector.h>

#include <cmath>
#include <memory>

#include "baselines/snake/snake.hpp"
#include "bindings.hpp"
#include "common/arrays.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using ffseg::Bytes;
using ffseg::Points;
using ffseg::Words;
using Altitudes = ffseg::Array<const double, nb::shape<-1, 4>>;

constexpr double kFar = 1e6;  // px; beyond it coordinates do not fit into pixel indices

bool between(double value, double low, double high) { return value >= low && value <= high; }

void check(const ffseg::snake::SnakeOptions& o) {
    ffseg::require(between(o.tension, 0, 1e3) && between(o.rigidity, 0, 1e3) && between(o.balloon, -64, 64) &&
                       between(o.attraction, 0, 1e3) && between(o.spacing, 0.5, 1e6) && between(o.tolerance, 0, 1e6) &&
                       o.max_iterations >= 0,
                   "a snake option is out of range");
}

std::vector<ffseg::snake::AltitudePoint> altitude_points(const Altitudes& rows, double epsilon) {
    std::vector<ffseg::snake::AltitudePoint> out;
    for (std::size_t i = 0; i < rows.shape(0); ++i) {
        const double* row = rows.data() + 4 * i;
        ffseg::require(between(row[0], -kFar, kFar) && between(row[1], -kFar, kFar) && std::isfinite(row[2]) &&
                           between(row[3], 0, 1e4),
                       "an altitude point (x, y, altitude, radius) is out of range");
        out.push_back({{row[0], row[1]}, row[3], row[2] < epsilon});
    }
    return out;
}

// The arrays stay alive as long as the snake that reads them.
struct PySnake {
    Words gradient;
    std::optional<Bytes> domain;
    std::unique_ptr<ffseg::snake::Snake> snake;

    PySnake(const Points& points, Words gradient_in, const Bytes& edges, std::optional<Bytes> domain_in,
            const Altitudes& altitudes, double epsilon, const ffseg::snake::SnakeOptions& options)
        : gradient(std::move(gradient_in)), domain(std::move(domain_in)) {
        check(options);
        const ffseg::Size size = ffseg::size_of(gradient, 32767);
        ffseg::check_size(edges, size);
        const std::uint8_t* const limits = ffseg::domain_of(domain, size);
        const std::vector<ffseg::snake::AltitudePoint> known = altitude_points(altitudes, epsilon);
        std::vector<ffseg::Vec2> start = ffseg::points_of(points, kFar);
        nb::gil_scoped_release release;
        ffseg::snake::SnakeField field{gradient.data(), size.height, size.width, limits,
                                       ffseg::snake::snake_zones(edges.data(), size.height, size.width, known)};
        snake = std::make_unique<ffseg::snake::Snake>(std::move(field), std::move(start), options);
    }

    bool advance(int most) {
        nb::gil_scoped_release release;
        return snake->advance(most);
    }

    const char* stop_reason() const { return ffseg::name_of(snake->stop()); }
};

}  // namespace

void bind_snake(nb::module_& m) {
    using Options = ffseg::snake::SnakeOptions;
    nb::class_<Options>(m, "SnakeOptions")
        .def(nb::init<>())
        .def_rw("tension", &Options::tension)
        .def_rw("rigidity", &Options::rigidity)
        .def_rw("balloon", &Options::balloon)
        .def_rw("attraction", &Options::attraction)
        .def_rw("spacing", &Options::spacing)
        .def_rw("tolerance", &Options::tolerance)
        .def_rw("refine", &Options::refine)
        .def_rw("budget", &Options::budget)
        .def_rw("max_iterations", &Options::max_iterations);
    nb::class_<PySnake>(m, "Snake")
        .def(nb::init<const Points&, Words, const Bytes&, std::optional<Bytes>, const Altitudes&, double,
                      const Options&>(),
             "points"_a, "gradient"_a, "edges"_a, "domain"_a.none(), "altitudes"_a, "epsilon"_a, "options"_a)
        .def("advance", &PySnake::advance, "iterations"_a, "Runs iterations; False once the snake has stopped.")
        .def(
            "points", [](const PySnake& s) { return ffseg::given_points(s.snake->points()); },
            "Points of the snake, (M, 2).")
        .def_prop_ro("iterations", [](const PySnake& s) { return s.snake->counts().iterations; })
        .def_prop_ro("insertions", [](const PySnake& s) { return s.snake->counts().insertions; })
        .def_prop_ro("removals", [](const PySnake& s) { return s.snake->counts().removals; })
        .def_prop_ro("stop_reason", &PySnake::stop_reason);
}
