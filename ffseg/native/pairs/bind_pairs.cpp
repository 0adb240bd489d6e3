#include <stdexcept>
#include <vector>

#include "bindings.hpp"
#include "pairs/patches.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Grey = nb::ndarray<const std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Rows = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Table = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

constexpr int kMaxRadius = 32;

ffseg::PlaneView view(const Grey& image) {
    if (image.shape(0) < 2 || image.shape(1) < 2 || image.shape(0) > 65535 || image.shape(1) > 65535) {
        throw std::invalid_argument("images must have 2 to 65535 pixels a side");
    }
    return {image.data(), static_cast<int>(image.shape(0)), static_cast<int>(image.shape(1))};
}

void check(bool right) {
    if (!right) throw std::invalid_argument("the arrays differ in size, or the radius or number of steps is out of range");
}

ffseg::Vec2 point(const Rows& rows, std::size_t row, std::size_t column = 0) {
    const double* p = rows.data() + row * rows.shape(1) + column;
    return {p[0], p[1]};
}

ffseg::Warp warp(const Rows& rows, std::size_t row, std::size_t column = 0) {
    const double* p = rows.data() + row * rows.shape(1) + column;
    return {p[0], p[1], p[2], p[3]};
}

// candidates (n, 2k), warps (n, 4k) -> scores (n, k)
void py_scores(const Grey& current, const Grey& previous, const Rows& centers, const Rows& candidates,
               const Rows& warps, int radius, Table out) {
    const ffseg::ImagePair pair{view(current), view(previous)};
    const std::size_t n = centers.shape(0), k = out.shape(1);
    check(centers.shape(1) == 2 && candidates.shape(0) == n && warps.shape(0) == n && out.shape(0) == n &&
          candidates.shape(1) == 2 * k && warps.shape(1) == 4 * k && radius >= 1 && radius <= kMaxRadius);
    nb::gil_scoped_release release;
    std::vector<ffseg::Vec2> places(k);
    std::vector<ffseg::Warp> shapes(k);
    for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = 0; j < k; ++j) {
            places[j] = point(candidates, i, 2 * j);
            shapes[j] = warp(warps, i, 4 * j);
        }
        ffseg::patch_scores(pair, point(centers, i), places.data(), shapes.data(), static_cast<int>(k), radius,
                            out.data() + i * k);
    }
}

// starts (n, 2), warps (n, 4) -> (n, 7): x, y, score, residual, normal xx, xy, yy
void py_align(const Grey& current, const Grey& previous, const Rows& centers, const Rows& starts, const Rows& warps,
              int radius, int steps, Table out) {
    const ffseg::ImagePair pair{view(current), view(previous)};
    const std::size_t n = centers.shape(0);
    check(centers.shape(1) == 2 && starts.shape(0) == n && starts.shape(1) == 2 && warps.shape(0) == n &&
          warps.shape(1) == 4 && out.shape(0) == n && out.shape(1) == 7 && radius >= 1 && radius <= kMaxRadius &&
          steps >= 0 && steps <= 1000);
    nb::gil_scoped_release release;
    for (std::size_t i = 0; i < n; ++i) {
        const ffseg::Alignment fit =
            ffseg::align_patch(pair, point(centers, i), point(starts, i), warp(warps, i), radius, steps);
        double* row = out.data() + 7 * i;
        row[0] = fit.position.x;
        row[1] = fit.position.y;
        row[2] = fit.score;
        row[3] = fit.residual;
        row[4] = fit.normal.xx;
        row[5] = fit.normal.xy;
        row[6] = fit.normal.yy;
    }
}

}  // namespace

void bind_pairs(nb::module_& m) {
    m.def("patch_scores", &py_scores, "current"_a, "previous"_a, "centers"_a, "candidates"_a, "warps"_a, "radius"_a,
          "out"_a, "Normalised cross-correlation of patches against warped candidates of the previous image, into `out`.");
    m.def("align_patches", &py_align, "current"_a, "previous"_a, "centers"_a, "starts"_a, "warps"_a, "radius"_a,
          "steps"_a, "out"_a, "Sub-pixel alignment of patches in the previous image, into `out`.");
}
