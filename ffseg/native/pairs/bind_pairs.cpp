#include <vector>

#include "bindings.hpp"
#include "common/arrays.hpp"
#include "pairs/interest.hpp"
#include "pairs/patches.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Grey = ffseg::Array<const std::uint8_t, nb::ndim<2>>;
using Rows = ffseg::Array<const double, nb::ndim<2>>;
using Table = ffseg::Array<double, nb::ndim<2>>;
using Bytes = ffseg::Array<const std::uint8_t, nb::ndim<1>>;
using Windows = ffseg::Array<const std::int64_t, nb::shape<-1, 4>>;
using Counts = ffseg::Array<std::int64_t, nb::ndim<1>>;

constexpr int kMaxRadius = 32;

ffseg::Picture view(const Grey& image) {
    ffseg::require(image.shape(0) > 1 && image.shape(1) > 1, "images must have 2 to 65535 pixels a side");
    return ffseg::picture_of(image);
}

void check(bool right) {
    ffseg::require(right, "the arrays differ in size, or the radius or number of steps is out of range");
}

ffseg::Vec2 point(const Rows& rows, std::size_t row, std::size_t column = 0) {
    const double* p = rows.data() + row * rows.shape(1) + column;
    return {p[0], p[1]};
}

ffseg::pairs::Warp warp(const Rows& rows, std::size_t row, std::size_t column = 0) {
    const double* p = rows.data() + row * rows.shape(1) + column;
    return {p[0], p[1], p[2], p[3]};
}

// Components packed one after another: windows (n, 4) of x, y, width, height, and their masks row by row.
std::vector<ffseg::pairs::ComponentWindow> regions(const ffseg::Picture& image, const Windows& windows,
                                                   const Bytes& masks) {
    std::vector<ffseg::pairs::ComponentWindow> found;
    std::size_t offset = 0;
    for (std::size_t i = 0; i < windows.shape(0); ++i) {
        const std::int64_t* w = windows.data() + 4 * i;
        const bool inside = w[0] >= 0 && w[1] >= 0 && w[2] >= 0 && w[3] >= 0 && w[0] <= image.width &&
                            w[1] <= image.height && w[2] <= image.width - w[0] && w[3] <= image.height - w[1];
        const std::size_t size = inside ? static_cast<std::size_t>(w[2] * w[3]) : 0;
        ffseg::require(inside && size <= masks.shape(0) - offset, "a window leaves the image, or its mask is missing");
        const std::uint8_t* first = masks.data() + offset;
        found.push_back({static_cast<int>(w[0]), static_cast<int>(w[1]), static_cast<int>(w[2]), static_cast<int>(w[3]),
                         std::vector<std::uint8_t>(first, first + size)});
        offset += size;
    }
    return found;
}

// points (n * most, 2), counts (n,): the points of one component after another, without gaps.
template <auto kFind>
void py_points(const Grey& image, const Windows& windows, const Bytes& masks, int grow, Table points, Counts counts) {
    const ffseg::Picture seen = view(image);
    const std::vector<ffseg::pairs::ComponentWindow> components = regions(seen, windows, masks);
    const std::size_t n = components.size(), most = n ? points.shape(0) / n : 0;
    check(points.shape(0) == n * most && points.shape(1) == 2 && counts.shape(0) == n && most <= 65535 && grow >= 0 &&
          grow <= kMaxRadius);
    nb::gil_scoped_release release;
    double* row = points.data();
    for (std::size_t i = 0; i < n; ++i) {
        counts.data()[i] = 0;
        if (components[i].mask.empty()) continue;
        const ffseg::pairs::ComponentWindow wide = ffseg::pairs::grown(components[i], grow, seen.width, seen.height);
        const std::vector<ffseg::Vec2> found = kFind(seen, wide, static_cast<int>(most));
        counts.data()[i] = static_cast<std::int64_t>(found.size());
        for (const ffseg::Vec2 p : found) {
            *row++ = p.x;
            *row++ = p.y;
        }
    }
}

// candidates (n, 2k), warps (n, 4k) -> scores (n, k)
void py_scores(const Grey& current, const Grey& previous, const Rows& centers, const Rows& candidates,
               const Rows& warps, int radius, double hopeless, Table out) {
    const ffseg::pairs::ImagePair pair{view(current), view(previous)};
    const std::size_t n = centers.shape(0), k = out.shape(1);
    check(centers.shape(1) == 2 && candidates.shape(0) == n && warps.shape(0) == n && out.shape(0) == n &&
          candidates.shape(1) == 2 * k && warps.shape(1) == 4 * k && radius >= 1 && radius <= kMaxRadius);
    nb::gil_scoped_release release;
    ffseg::pairs::Candidates tried{std::vector<ffseg::Vec2>(k), std::vector<ffseg::pairs::Warp>(k)};
    for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = 0; j < k; ++j) {
            tried.places[j] = point(candidates, i, 2 * j);
            tried.warps[j] = warp(warps, i, 4 * j);
        }
        ffseg::pairs::patch_scores(pair, point(centers, i), tried, radius, hopeless, out.data() + i * k);
    }
}

// starts (n, 2), warps (n, 4) -> (n, 7): x, y, score, residual, normal xx, xy, yy
void py_align(const Grey& current, const Grey& previous, const Rows& centers, const Rows& starts, const Rows& warps,
              int radius, int steps, Table out) {
    const ffseg::pairs::ImagePair pair{view(current), view(previous)};
    const std::size_t n = centers.shape(0);
    check(centers.shape(1) == 2 && starts.shape(0) == n && starts.shape(1) == 2 && warps.shape(0) == n &&
          warps.shape(1) == 4 && out.shape(0) == n && out.shape(1) == 7 && radius >= 1 && radius <= kMaxRadius &&
          steps >= 0 && steps <= 1000);
    nb::gil_scoped_release release;
    for (std::size_t i = 0; i < n; ++i) {
        const ffseg::pairs::Alignment fit =
            ffseg::pairs::align_patch(pair, point(centers, i), point(starts, i), warp(warps, i), radius, steps);
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
    m.def("harris_points", &py_points<ffseg::pairs::harris_points>, "image"_a, "windows"_a, "masks"_a, "grow"_a,
          "points"_a, "counts"_a,
          "Harris corners of components grown by `grow` pixels, strongest first, into `points`.");
    m.def("outline_points", &py_points<ffseg::pairs::outline_points>, "image"_a, "windows"_a, "masks"_a, "grow"_a,
          "points"_a, "counts"_a,
          "Samples of the strongest edges of components grown by `grow` pixels, into `points`.");
    m.def("patch_scores", &py_scores, "current"_a, "previous"_a, "centers"_a, "candidates"_a, "warps"_a, "radius"_a,
          "hopeless"_a, "out"_a,
          "Normalised cross-correlation of patches against warped candidates of the previous image, into `out`.");
    m.def("align_patches", &py_align, "current"_a, "previous"_a, "centers"_a, "starts"_a, "warps"_a, "radius"_a,
          "steps"_a, "out"_a, "Sub-pixel alignment of patches in the previous image, into `out`.");
}
