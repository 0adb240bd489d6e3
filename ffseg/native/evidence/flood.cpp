#include "evidence/flood.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ffseg::evidence {
namespace {

constexpr std::uint16_t kUnseen = 65535;

// Pixels by level, lowest level first; a level may grow while it is worked on. Dropping levels behind, it is a ring.
class Buckets {
public:
    explicit Buckets(std::size_t levels) : buckets_(levels) {}
    void put(std::size_t level, int pixel) {
        buckets_[level % buckets_.size()].push_back(pixel);
        ++waiting_;
    }
    // Calls `visit(level, pixel)` until nothing waits.
    template <class Visit>
    void empty(const Visit& visit) {
        for (std::size_t level = 0; waiting_ > 0; ++level) {
            std::vector<int>& bucket = buckets_[level % buckets_.size()];
            while (!bucket.empty()) {
                const int pixel = bucket.back();
                bucket.pop_back();
                --waiting_;
                visit(level, pixel);
            }
        }
    }

private:
    std::vector<std::vector<int>> buckets_;
    std::size_t waiting_ = 0;
};

// Calls `visit` with each of the eight (or four) neighbours inside the plane, and whether it lies along a diagonal.
template <class Visit>
void neighbours(int pixel, Size size, bool diagonals, const Visit& visit) {
    const int x = pixel % size.width, y = pixel / size.width;
    for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
            const bool diagonal = dx != 0 && dy != 0;
            const bool within = x + dx >= 0 && x + dx < size.width && y + dy >= 0 && y + dy < size.height;
            if ((dx != 0 || dy != 0) && within && (diagonals || !diagonal)) {
                visit(pixel + dy * size.width + dx, diagonal);
            }
        }
    }
}

// Natural logarithm of a height in steps over `unit` steps; half a step keeps zero finite.
float logarithm(int level, double unit) { return static_cast<float>(std::log((level + 0.5) / (unit + 0.5))); }

double median_inside(const std::vector<std::uint16_t>& heights, const std::uint8_t* inside) {
    std::vector<std::uint16_t> found;
    for (std::size_t i = 0; i < heights.size(); ++i) {
        if (inside[i] != 0) found.push_back(heights[i]);
    }
    if (found.empty()) return 0;
    const auto middle = found.begin() + static_cast<std::ptrdiff_t>(found.size() / 2);
    std::nth_element(found.begin(), middle, found.end());
    return *middle;
}

}  // namespace

std::vector<std::uint16_t> stepped(const float* heights, std::size_t count, double step) {
    std::vector<std::uint16_t> levels(count);
    const float scale = static_cast<float>(1 / step);
    for (std::size_t i = 0; i < count; ++i) {
        const float level = heights[i] * scale + 0.5F;
        levels[i] = static_cast<std::uint16_t>(!(level > 0)        ? 0
                                               : level >= kHighest ? kHighest
                                                                   : static_cast<int>(level));
    }
    return levels;
}

void barrier(const std::uint16_t* heights, const std::uint8_t* inside, Size size, std::uint16_t* out) {
    Buckets buckets(kHighest + 1);
    for (std::size_t i = 0; i < size.count(); ++i) {
        out[i] = inside[i] != 0 ? 0 : kUnseen;
        if (inside[i] != 0) buckets.put(0, static_cast<int>(i));
    }
    buckets.empty([&](std::size_t level, int pixel) {
        neighbours(pixel, size, false, [&](int next, bool) {
            if (out[next] != kUnseen) return;
            out[next] = std::max(heights[next], static_cast<std::uint16_t>(level));
            buckets.put(out[next], next);
        });
    });
    for (std::size_t i = 0; i < size.count(); ++i) {
        if (out[i] == kUnseen) out[i] = kHighest;  // there is no start
    }
}

void barrier_planes(const float* heights, const std::uint8_t* inside, Size size, double step, float* out) {
    const std::size_t count = size.count();
    const std::vector<std::uint16_t> levels = stepped(heights, count, step);
    std::vector<std::uint16_t> barriers(count);
    barrier(levels.data(), inside, size, barriers.data());
    std::vector<std::size_t> pixels(kHighest + 1);
    for (const std::uint16_t one : barriers) ++pixels[one];
    constexpr int kClasses = 10;  // a factor of e
    const double unit = median_inside(levels, inside);
    const auto class_of = [&](int level) { return static_cast<std::size_t>(kClasses * std::log(2.0 * level + 1)); };
    std::vector<std::size_t> alike(class_of(kHighest) + 1);
    for (int level = 0; level <= kHighest; ++level) alike[class_of(level)] += pixels[static_cast<std::size_t>(level)];
    std::vector<float> table(static_cast<std::size_t>(kHighest + 1) * kBarrierPlanes);
    const double share = 1.0 / static_cast<double>(count);
    std::size_t below = 0;
    for (int level = 0; level <= kHighest; ++level) {
        const std::size_t same = pixels[static_cast<std::size_t>(level)];
        below += same;
        float* row = table.data() + static_cast<std::size_t>(level) * kBarrierPlanes;
        row[0] = static_cast<float>(level * step);
        row[1] = logarithm(level, unit);
        row[2] = static_cast<float>(static_cast<double>(below) * share);
        row[3] = static_cast<float>(static_cast<double>(same) * share);
        row[4] = static_cast<float>(static_cast<double>(alike[class_of(level)]) * share);
    }
    for (std::size_t i = 0; i < count; ++i) {
        const float* row = table.data() + static_cast<std::size_t>(barriers[i]) * kBarrierPlanes;
        for (std::size_t k = 0; k < kBarrierPlanes; ++k) out[k * count + i] = row[k];
    }
}

void geodesic(const float* heights, const std::uint8_t* inside, Size size, double step, int least, float* out) {
    const std::vector<std::uint16_t> levels = stepped(heights, size.count(), step);
    constexpr unsigned kStraight = 5, kSlanted = 7;
    constexpr unsigned kFar = std::numeric_limits<unsigned>::max();
    // the cost of a pixel is shared by the steps into it and out of it
    Buckets buckets(2 * static_cast<std::size_t>(kHighest + least) * kSlanted + 1);
    std::vector<unsigned> costs(size.count(), kFar);
    for (std::size_t i = 0; i < size.count(); ++i) {
        if (inside[i] == 0) continue;
        costs[i] = 0;
        buckets.put(0, static_cast<int>(i));
    }
    buckets.empty([&](std::size_t cost, int pixel) {
        if (costs[static_cast<std::size_t>(pixel)] < cost) return;
        const unsigned leave = levels[static_cast<std::size_t>(pixel)] + static_cast<unsigned>(least);
        neighbours(pixel, size, true, [&](int next, bool diagonal) {
            const auto at = static_cast<std::size_t>(next);
            const unsigned enter = levels[at] + static_cast<unsigned>(least);
            const unsigned sum = static_cast<unsigned>(cost) + (leave + enter) * (diagonal ? kSlanted : kStraight);
            if (sum >= costs[at]) return;
            costs[at] = sum;
            buckets.put(sum, next);
        });
    });
    const float scale = static_cast<float>(step / (2 * kStraight));
    for (std::size_t i = 0; i < size.count(); ++i)
        out[i] = costs[i] == kFar ? 0.0F : static_cast<float>(costs[i]) * scale;
}

}  // namespace ffseg::evidence
