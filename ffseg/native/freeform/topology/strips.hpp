// The bounding-box filter: which boxes may meet, from boxes sorted by their left sides.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "common/vec.hpp"

namespace ffseg::topology {

// One horizontal strip of the image with the boxes that intersect it, from left to right, in single precision and
// slightly enlarged: boxes that do not meet here do not meet.
class Strip {
public:
    // Empty, with room for so many boxes.
    void reset(std::size_t room) {
        count_ = 0;
        if (name_.size() >= room + kBlock) return;
        for (auto* side : {&left_, &right_, &top_, &bottom_}) side->resize(room + kBlock);
        name_.resize(room + kBlock);
        moving_.resize(room + kBlock);
        next_moving_.resize(room + 1);
    }
    FFSEG_INLINE void push(const Box& box, int name, bool moving) {
        constexpr float kSlack = 0.01f;  // the rounding of coordinates below 2^16 is 0.004
        left_[count_] = static_cast<float>(box.x0) - kSlack;
        right_[count_] = static_cast<float>(box.x1) + kSlack;
        top_[count_] = static_cast<float>(box.y0) - kSlack;
        bottom_[count_] = static_cast<float>(box.y1) + kSlack;
        name_[count_] = name;
        moving_[count_] = moving;
        ++count_;
    }

    // Calls visit(i, j) for boxes that may meet, one of them moving, until it returns true for this i; neighbours(i)
    // are two names left out. True if any call returned true.
    template <typename Neighbours, typename Visit>
    bool each_meeting(Neighbours neighbours, Visit visit) {
        const std::size_t count = count_;
        std::fill_n(left_.begin() + static_cast<std::ptrdiff_t>(count), kBlock, std::numeric_limits<float>::infinity());
        next_moving_[count] = count;
        for (std::size_t at = count, next = count; at-- > 0;) {
            next = moving_[at] != 0 ? at : next;
            next_moving_[at] = next;
        }
        bool any = false;
        for (std::size_t at = 0; at < count; ++at) {
            const bool moving = moving_[at] != 0;
            const std::size_t first = moving ? at + 1 : next_moving_[at + 1];
            if (!(left_[first] <= right_[at])) continue;
            any |= visit_from(first, {left_[at], right_[at], top_[at], bottom_[at]}, moving, neighbours(name_[at]),
                              [&](int j) { return visit(name_[at], j); });
        }
        return any;
    }

private:
    static constexpr std::size_t kBlock = 8;
    struct Sides {
        float left, right, top, bottom;
    };

    template <typename Visit>
    bool visit_from(std::size_t first, Sides sides, bool moving, std::array<int, 2> without, Visit visit) const {
        const int all = moving ? 1 : 0;
        const auto meets = [&](std::size_t on) {
            return static_cast<int>(left_[on] <= sides.right) & static_cast<int>(top_[on] <= sides.bottom) &
                   static_cast<int>(bottom_[on] >= sides.top) & static_cast<int>(name_[on] != without[0]) &
                   static_cast<int>(name_[on] != without[1]) & (moving_[on] | all);
        };
        for (std::size_t block = first; left_[block] <= sides.right; block += kBlock) {
            int some = 0;  // mostly none does: tested together, without branches
            for (std::size_t on = block; on < block + kBlock; ++on) some |= meets(on);
            for (std::size_t on = block; some != 0 && on < block + kBlock; ++on) {
                if (meets(on) != 0 && visit(name_[on])) return true;
            }
        }
        return false;
    }

    std::size_t count_ = 0;
    std::vector<float> left_, right_, top_, bottom_;
    std::vector<int> name_, moving_;
    std::vector<std::size_t> next_moving_;
};

}  // namespace ffseg::topology
