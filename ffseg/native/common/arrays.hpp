// What the bindings take from NumPy and give to it.
#pragma once
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/picture.hpp"
#include "common/vec.hpp"

namespace ffseg {

template <class T, class... Shape>
using Array = nanobind::ndarray<T, Shape..., nanobind::c_contig, nanobind::device::cpu>;

using Points = Array<const double, nanobind::shape<-1, 2>>;
using Indices = Array<const std::int64_t, nanobind::ndim<1>>;
using Bytes = Array<const std::uint8_t, nanobind::ndim<2>>;
using Whole = Array<const std::int32_t, nanobind::ndim<2>>;
using Words = Array<const std::uint16_t, nanobind::ndim<2>>;
using Colours = Array<const std::uint8_t, nanobind::ndim<3>>;

inline void require(bool holds, const char* what) {
    if (!holds) throw std::invalid_argument(what);
}

// Rows and columns of a plane or picture: at least one, at most so many of each.
template <class Plane>
Size size_of(const Plane& plane, std::size_t most = kMaxSide) {
    const std::size_t height = plane.shape(0), width = plane.shape(1);
    if (height < 1 || width < 1 || height > most || width > most) {
        throw std::invalid_argument("the image must have 1 to " + std::to_string(most) + " pixels a side");
    }
    return {static_cast<int>(height), static_cast<int>(width)};
}

template <class Plane>
void check_size(const Plane& plane, Size size) {
    const bool same = plane.shape(0) == static_cast<std::size_t>(size.height) &&
                      plane.shape(1) == static_cast<std::size_t>(size.width);
    if (!same) throw std::invalid_argument("the arrays differ in size");
}

// The pixels of a domain; null, which is everywhere, where there is none.
inline const std::uint8_t* domain_of(const std::optional<Bytes>& domain, Size size) {
    if (!domain) return nullptr;
    check_size(*domain, size);
    return domain->data();
}

// The picture in an array (H, W) or (H, W, C), which keeps it.
template <class Image>
Picture picture_of(const Image& image, std::size_t most_channels = kMaxChannels) {
    require(image.ndim() == 2 || image.ndim() == 3, "the image must be (H, W) or (H, W, C)");
    const std::size_t channels = image.ndim() == 3 ? image.shape(2) : 1;
    require(channels >= 1 && channels <= most_channels, "the image has no channels or too many");
    const Size size = size_of(image);
    return {image.data(), size.height, size.width, static_cast<int>(channels)};
}

// The points, whose coordinates must be numbers of at most this size.
inline std::vector<Vec2> points_of(const Points& points, double farthest = std::numeric_limits<double>::max()) {
    std::vector<Vec2> checked(points.shape(0));
    for (std::size_t i = 0; i < checked.size(); ++i) {
        checked[i] = {points.data()[2 * i], points.data()[2 * i + 1]};
        const bool near = std::abs(checked[i].x) <= farthest && std::abs(checked[i].y) <= farthest;
        if (!near) throw std::invalid_argument("a point is not finite or too far away");
    }
    return checked;
}

// Where contours end that lie one after another in so many points: contour c is what lies between ends c and c + 1.
inline std::vector<std::size_t> ends_of(const Indices& offsets, std::size_t count) {
    std::vector<std::size_t> ends;
    std::int64_t last = 0;
    for (std::size_t c = 0; c < offsets.shape(0); ++c) {
        const std::int64_t at = offsets.data()[c];
        require(at >= last && at <= static_cast<std::int64_t>(count) && (c > 0 || at == 0),
                "offsets must begin with 0, rise and end within the points");
        ends.push_back(static_cast<std::size_t>(last = at));
    }
    return ends;
}

// The same of closed contours of one degree that the free form may begin with.
inline std::vector<std::size_t> patch_ends_of(const Indices& offsets, std::size_t count, int degree) {
    std::vector<std::size_t> ends = ends_of(offsets, count);
    const auto least = static_cast<std::size_t>(degree);
    for (std::size_t c = 1; c < ends.size(); ++c) {
        const std::size_t size = ends[c] - ends[c - 1];
        require(size >= 2 * least && size % least == 0,
                "a contour needs two patches or more of `degree` control points each");
    }
    return ends;
}

// Values as an array that owns them.
template <class T>
nanobind::ndarray<nanobind::numpy, T> given(std::vector<T> values) {
    auto* kept = new std::vector<T>(std::move(values));
    nanobind::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    return nanobind::ndarray<nanobind::numpy, T>(kept->data(), {kept->size()}, owner);
}

// Points as an array of shape (M, 2).
inline nanobind::ndarray<nanobind::numpy, double> given_points(const std::vector<Vec2>& points) {
    auto* flat = new double[2 * points.size() + 1];
    nanobind::capsule owner(flat, [](void* p) noexcept { delete[] static_cast<double*>(p); });
    for (std::size_t i = 0; i < points.size(); ++i) {
        flat[2 * i] = points[i].x;
        flat[2 * i + 1] = points[i].y;
    }
    return nanobind::ndarray<nanobind::numpy, double>(flat, {points.size(), 2}, owner);
}

// Contours as such an array and the list of their ends.
inline nanobind::tuple given_contours(const std::vector<Vec2>& points, const std::vector<std::size_t>& ends) {
    nanobind::list list;
    for (const std::size_t end : ends) list.append(end);
    return nanobind::make_tuple(given_points(points), list);
}

}  // namespace ffseg
