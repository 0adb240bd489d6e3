// Points along a polygon.
#pragma once
#include <algorithm>
#include <cstddef>

#include "common/vec.hpp"

namespace ffseg {

// Goes along an open or closed polygon of at least two points, which outlives it.
class Along {
public:
    Along(const Vec2* points, std::size_t count, bool closed)
        : points_(points), count_(count), sides_(closed ? count : count - 1) {
        for (std::size_t i = 0; i < sides_; ++i) length_ += norm(corner(i + 1) - points_[i]);
        side_ = norm(corner(1) - points_[0]);
    }

    double length() const { return length_; }

    // The point at this distance from the first, which must not be less than in the call before.
    Vec2 at(double distance) {
        while (on_ + 1 < sides_ && passed_ + side_ < distance) {
            passed_ += side_;
            ++on_;
            side_ = norm(corner(on_ + 1) - points_[on_]);
        }
        const double u = side_ > 0 ? std::min(1.0, (distance - passed_) / side_) : 0.0;
        return points_[on_] + u * (corner(on_ + 1) - points_[on_]);
    }

private:
    Vec2 corner(std::size_t i) const { return points_[i < count_ ? i : 0]; }

    const Vec2* points_;
    std::size_t count_, sides_, on_ = 0;
    double length_ = 0.0, passed_ = 0.0, side_ = 0.0;
};

}  // namespace ffseg
