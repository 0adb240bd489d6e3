// What the bindings take from NumPy and give to it.
#pragma once
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cmath>
#include <cstdint>
#include <stdexcept>
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

// The image in an array of 1 to 65535 pixels a side and one to three channels, which keeps it.
inline Picture picture_of(const Colours& image) {
    const std::size_t height = image.shape(0), width = image.shape(1), channels = image.shape(2);
    if (height < 1 || width < 1 || height > 65535 || width > 65535 || channels < 1 || channels > kMostChannels) {
        throw std::invalid_argument("an image must have 1 to 65535 pixels a side and one to three channels");
    }
    return {image.data(), static_cast<int>(height), static_cast<int>(width), static_cast<int>(channels)};
}

// The points, whose coordinates must be numbers of at most this size.
inline std::vector<Vec2> points_of(const Points& points, double farthest) {
    std::vector<Vec2> checked(points.shape(0));
    for (std::size_t i = 0; i < checked.size(); ++i) {
        checked[i] = {points.data()[2 * i], points.data()[2 * i + 1]};
        if (!(std::abs(checked[i].x) <= farthest && std::abs(checked[i].y) <= farthest)) {
            throw std::invalid_argument("a point is not finite or too far away");
        }
    }
    return checked;
}

// Where contours end that lie one after another in so many points: contour c is what lies between ends c and c + 1.
inline std::vector<std::size_t> ends_of(const Indices& offsets, std::size_t count) {
    std::vector<std::size_t> ends;
    std::int64_t last = 0;
    for (std::size_t c = 0; c < offsets.shape(0); ++c) {
        const std::int64_t at = offsets.data()[c];
        if (at < last || at > static_cast<std::int64_t>(count) || (c == 0 && at != 0)) {
            throw std::invalid_argument("offsets must begin with 0, rise and end within the points");
        }
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
        if (size < 2 * least || size % least != 0) {
            throw std::invalid_argument("a contour needs two patches or more of `degree` control points each");
        }
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
