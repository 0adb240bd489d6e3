// A priority queue for fronts that only move forward: exact order (time, then node), at the price of a bucket.
#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "common/lanes.hpp"

namespace ffseg::marching {

// A front node with the time at which it would be reached.
struct Arrival {
    double time;
    std::int32_t node;
};

struct Later {
    bool operator()(const Arrival& a, const Arrival& b) const {
        return a.time > b.time || (a.time == b.time && a.node > b.node);
    }
};

// Nodes wait in buckets of one width in time; only the bucket at the front is kept in order. What lies beyond the ring
// of buckets waits in `far_`. All times of a bucket lie before those of the next, so the order is that
// of one heap over everything. A node whose time has fallen is pushed again; the place it left is skipped.
class ArrivalQueue {
public:
    // `time` is the current time of each node and outlives the queue.
    ArrivalQueue(double width, const double* time, std::int32_t stride)
        : least_inverse_(1.0 / width), inverse_(least_inverse_), time_(time), stride_(stride), ring_(kBuckets) {}

    // The node's time must have been set already.
    void push(std::int32_t node) {
        const double slot = slot_of(node);
        if (slot < current_ + 1) {
            late_.push_back({time_[node], node});
            std::push_heap(late_.begin(), late_.end(), Later{});
        } else if (slot < kBuckets) {
            ring_[static_cast<std::size_t>(slot)].push_back(node);
            ++waiting_;
        } else {
            far_.push_back(node);
        }
    }

    // Next arrival, or false when there is none left.
    bool pop(Arrival& next) {
        do {
            while (front_.empty() && late_.empty()) {
                if (!advance()) return false;
            }
            next = take_first();
        } while (next.time != time_[next.node] || next.node == last_.node);
        last_ = next;
        return true;
    }

private:
    static constexpr int kBuckets = 4096;

    double slot_of(std::int32_t node) const { return (time_[node] - base_) * inverse_; }

    Arrival take_first() {
        std::vector<Arrival>* from = &front_;
        if (front_.empty() || (!late_.empty() && Later{}(front_.back(), late_.front()))) {
            std::pop_heap(late_.begin(), late_.end(), Later{});
            from = &late_;
        }
        const Arrival first = from->back();
        from->pop_back();
        return first;
    }

    bool advance() {
        if (waiting_ == 0) {
            if (far_.empty()) return false;
            wrap();
        } else {
            ++current_;
        }
        std::vector<std::int32_t>& bucket = ring_[static_cast<std::size_t>(current_)];
        waiting_ -= bucket.size();
        for (const std::int32_t node : bucket) {  // a node of an earlier bucket has left this one
            if (slot_of(node) < current_) continue;
            front_.push_back({time_[node], node});
            for (int row = -2; row <= 2; ++row) FFSEG_PREFETCH(time_ + node + row * stride_);
        }
        bucket.clear();
        std::sort(front_.begin(), front_.end(), Later{});
        return true;
    }

    // The ring is used up: it starts again at the first node that waits beyond it. Where slownesses differ by orders of
    // magnitude the next nodes may lie very far apart; buckets become wide enough then for half of all that wait, or
    // every wrap would look at them all to move a few.
    void wrap() {
        const auto left = [this](std::int32_t node) { return time_[node] <= last_.time; };
        far_.erase(std::remove_if(far_.begin(), far_.end(), left), far_.end());
        current_ = 0;
        if (far_.empty()) return;
        base_ = time_[far_.front()];
        for (const std::int32_t node : far_) base_ = std::min(base_, time_[node]);
        inverse_ = least_inverse_;
        const auto near =
            std::count_if(far_.begin(), far_.end(), [this](std::int32_t n) { return slot_of(n) < kBuckets; });
        if (static_cast<std::size_t>(near) < far_.size() / 8) widen();
        std::size_t kept = 0;
        for (const std::int32_t node : far_) {
            const double slot = slot_of(node);
            if (slot < kBuckets) {
                ring_[static_cast<std::size_t>(slot)].push_back(node);
                ++waiting_;
            } else {
                far_[kept++] = node;
            }
        }
        far_.resize(kept);
    }

    void widen() {
        const auto middle = far_.begin() + static_cast<std::ptrdiff_t>(far_.size() / 2);
        std::nth_element(far_.begin(), middle, far_.end(),
                         [this](std::int32_t a, std::int32_t b) { return time_[a] < time_[b]; });
        inverse_ = 0.5 * kBuckets / (time_[*middle] - base_);
    }

    double least_inverse_, inverse_;  // 1 / width at first, and now
    const double* time_;
    std::int32_t stride_;
    double base_ = 0.0;
    int current_ = 0;
    std::size_t waiting_ = 0;  // nodes in the ring
    std::vector<std::vector<std::int32_t>> ring_;
    Arrival last_{-1.0, -1};
    std::vector<Arrival> front_;  // the bucket at the front, last to first
    std::vector<Arrival> late_;   // what came into it later, as a heap
    std::vector<std::int32_t> far_;
};

}  // namespace ffseg::marching
