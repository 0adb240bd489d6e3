#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "baselines/levelset/levelset.hpp"
#include "baselines/levelset/outline.hpp"
#include "baselines/marching/march.hpp"
#include "bindings.hpp"
#include "common/arrays.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using ffseg::Bytes;
using ffseg::given;
using ffseg::Words;
using PlaneF = ffseg::Array<const double, nb::ndim<2>>;
using Table = ffseg::Array<const double, nb::shape<65536>>;

// Beyond it the square of a slowness or the sum of two times could overflow.
constexpr double kMaxSpeed = 1e100, kMinSpeed = 1e-100;

constexpr std::size_t kMaxMarched = 32767;

template <class Plane>
ffseg::marching::Grid grid_of(const Plane& plane, std::size_t most = kMaxMarched) {
    const ffseg::Size size = ffseg::size_of(plane, most);
    const ffseg::marching::Grid grid{size.height, size.width};
    if (grid.size() > std::size_t{std::numeric_limits<std::int32_t>::max()}) {
        throw std::invalid_argument("the image has more pixels than can be numbered");
    }
    return grid;
}

// Slowness on the grid with its ring; the ring and all that is not faster than `stop` is infinite.
std::vector<double> slowness_of(const ffseg::marching::Grid& grid, const double* speed, double stop) {
    std::vector<double> slowness(grid.size(), std::numeric_limits<double>::infinity());
    for (int y = 0; y < grid.height; ++y) {
        double* row = slowness.data() + grid.node(0, y);
        for (int x = 0; x < grid.width; ++x, ++speed) {
            if (!(*speed >= 0 && *speed <= kMaxSpeed)) throw std::invalid_argument("a speed is negative or not finite");
            if (*speed > std::max(stop, kMinSpeed)) row[x] = 1.0 / *speed;
        }
    }
    return slowness;
}

std::vector<std::int32_t> raster_index(const ffseg::marching::Grid& grid, const std::vector<std::int32_t>& nodes) {
    std::vector<std::int32_t> index;
    index.reserve(nodes.size());
    for (const std::int32_t node : nodes) index.push_back(grid.y(node) * grid.width + grid.x(node));
    return index;
}

nb::tuple py_march(const PlaneF& speed, double stop, const Bytes& inside, std::optional<Bytes> domain) {
    const ffseg::marching::Grid grid = grid_of(speed);
    ffseg::check_size(inside, {grid.height, grid.width});
    ffseg::require(stop >= 0, "the stop speed must not be negative");
    ffseg::marching::March march(grid, ffseg::domain_of(domain, {grid.height, grid.width}));
    std::vector<double> time(static_cast<std::size_t>(grid.height) * static_cast<std::size_t>(grid.width));
    std::size_t initial = 0;
    {
        nb::gil_scoped_release release;
        const std::vector<double> values = slowness_of(grid, speed.data(), stop);
        const ffseg::marching::SlownessPlane slowness{values.data()};
        march.accept(inside.data());
        ffseg::marching::ArrivalQueue queue(ffseg::marching::bucket_width(grid, slowness), march.time.data(),
                                            march.grid.stride());
        march.begin(slowness, queue);
        initial = march.met;
        march.run(slowness, queue);
        for (int y = 0; y < grid.height; ++y) {
            std::copy_n(march.time.data() + grid.node(0, y), grid.width,
                        time.data() + static_cast<std::ptrdiff_t>(y) * grid.width);
        }
        for (double& t : time) t = std::isnan(t) ? std::numeric_limits<double>::infinity() : t;
        march.order = raster_index(grid, march.order);
        march.on_contour = raster_index(grid, march.on_contour);
    }
    return nb::make_tuple(given(std::move(time)), given(std::move(march.order)), given(std::move(march.on_contour)),
                          initial);
}

struct LevelSetOptions {
    int stop = 0, reach = 0;  // defaults live with the parameters
    bool closing_in = false;
    double min_area = 0.0;
};

nb::tuple py_level_set(const Words& gradient, const Table& slowness, const Bytes& inside, std::optional<Bytes> domain,
                       const LevelSetOptions& options) {
    const ffseg::marching::Grid grid = grid_of(gradient);
    ffseg::check_size(inside, {grid.height, grid.width});
    const std::uint8_t* const limits = ffseg::domain_of(domain, {grid.height, grid.width});
    ffseg::require(options.stop >= 1 && options.stop <= 65536 && options.reach >= 0 && options.reach <= 64 &&
                       options.min_area >= 0,
                   "a level set option is out of range");
    for (int level = 0; level < 65536; ++level) {
        const double value = slowness.data()[level];
        const bool fits = level < options.stop ? value >= kMinSpeed && value <= kMaxSpeed : std::isinf(value);
        if (!fits) throw std::invalid_argument("the slowness must be finite below `stop` and infinite from there on");
    }
    ffseg::levelset::LevelSetResult result;
    {
        nb::gil_scoped_release release;
        const ffseg::levelset::LevelSetInput input{
            grid,         gradient.data(), slowness.data(),    inside.data(),   limits,
            options.stop, options.reach,   options.closing_in, options.min_area};
        result = ffseg::levelset::level_set(input);
    }
    std::vector<double> flat;
    flat.reserve(2 * result.points.size());
    for (const ffseg::Vec2 p : result.points) flat.insert(flat.end(), {p.x, p.y});
    std::vector<std::int64_t> bounds(result.offsets.begin(), result.offsets.end());
    nb::dict counts;
    counts["accepted"] = result.accepted;
    counts["initial_band"] = result.initial_band;
    counts["on_contour"] = result.on_contour;
    return nb::make_tuple(given(std::move(flat)), given(std::move(bounds)), counts);
}

nb::tuple py_outlines(const Bytes& mask) {
    const ffseg::marching::Grid grid = grid_of(mask, ffseg::kMaxSide);
    std::vector<double> flat;
    std::vector<std::int64_t> ends{0};
    {
        nb::gil_scoped_release release;
        for (const std::vector<ffseg::Vec2>& outline : ffseg::levelset::Region(grid, mask.data()).outlines(nullptr)) {
            for (const ffseg::Vec2 p : outline) flat.insert(flat.end(), {p.x, p.y});
            ends.push_back(static_cast<std::int64_t>(flat.size() / 2));
        }
    }
    return nb::make_tuple(given(std::move(flat)), given(std::move(ends)));
}

}  // namespace

void bind_levelset(nb::module_& m) {
    m.def("fast_march", &py_march, "speed"_a, "stop_speed"_a, "inside"_a, "domain"_a.none(),
          "Arrival times (H * W), accepted nodes in order, on-contour nodes, size of the first narrow band.");
    m.def("mask_outlines", &py_outlines, "mask"_a,
          "Outlines (flat x, y) half-way between pixels inside and outside, and their offsets; holes turn the other "
          "way.");
    nb::class_<LevelSetOptions>(m, "LevelSetOptions")
        .def(nb::init<>())
        .def_rw("stop", &LevelSetOptions::stop)
        .def_rw("reach", &LevelSetOptions::reach)
        .def_rw("closing_in", &LevelSetOptions::closing_in)
        .def_rw("min_area", &LevelSetOptions::min_area);
    m.def("level_set", &py_level_set, "gradient"_a, "slowness"_a, "inside"_a, "domain"_a.none(), "options"_a,
          "Outlines (flat x, y), their offsets and the counts of a level set.");
}
