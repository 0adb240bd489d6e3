#include "evidence/flood.hpp"

#include <algorithm>
#include <limits>

#include "evidence/elementary.hpp"

namespace ffseg::evidence {
namespace {

constexpr std::uint16_t kUnseen = 65535;

// Pixels by level, lowest level first; a level may grow while it is worked on. Dropping levels behind, it is a ring.
class Buckets {
public:
    Buckets(std::size_t levels, std::size_t pixels) : first_(levels, kNone) { entries_.reserve(pixels); }
    void put(std::size_t level, int pixel) {
        int& first = first_[level];
        int at = free_;
        if (at == kNone) {
            at = static_cast<int>(entries_.size());
            entries_.push_back({pixel, first});
        } else {
            Entry& entry = entries_[static_cast<std::size_t>(at)];
            free_ = entry.next;
            entry = {pixel, first};
        }
        first = at;
        ++waiting_;
    }
    // Calls `visit(level, place of the level in the ring, pixel)` until nothing waits.
    template <class Visit>
    void empty(const Visit& visit) {
        for (std::size_t level = 0, place = 0; waiting_ > 0;
             ++level, place = place + 1 == first_.size() ? 0 : place + 1) {
            for (int at = first_[place]; at != kNone; at = first_[place]) {
                Entry& entry = entries_[static_cast<std::size_t>(at)];
                const int pixel = entry.pixel;
                first_[place] = entry.next;
                entry.next = free_;
                free_ = at;
                --waiting_;
                visit(level, place, pixel);
            }
        }
    }
    std::size_t levels() const { return first_.size(); }

private:
    struct Entry {
        int pixel, next;
    };
    static constexpr int kNone = -1;
    std::vector<int> first_;
    std::vector<Entry> entries_;
    int free_ = kNone;
    std::size_t waiting_ = 0;
};

// A plane with a border of one pixel, so that every pixel has eight neighbours.
template <class Value>
class Bordered {
public:
    Bordered(Size size, Value border)
        : size_(size),
          width_(static_cast<std::size_t>(size.width) + 2),
          values_(width_ * (static_cast<std::size_t>(size.height) + 2), border) {}

    // Calls `visit(value, place in a plane without border, place)` for each pixel.
    template <class Visit>
    void each(const Visit& visit) {
        std::size_t plain = 0;
        for (int y = 0; y < size_.height; ++y) {
            std::size_t at = (static_cast<std::size_t>(y) + 1) * width_ + 1;
            for (int x = 0; x < size_.width; ++x, ++at, ++plain) visit(values_[at], plain, static_cast<int>(at));
        }
    }
    Value& operator[](int at) { return values_[static_cast<std::size_t>(at)]; }
    int width() const { return static_cast<int>(width_); }
    std::size_t count() const { return values_.size(); }

private:
    Size size_;
    std::size_t width_;
    std::vector<Value> values_;
};

// Natural logarithm of a height in steps over `unit` steps; half a step keeps zero finite.
float log_ratio(double level, double unit) { return static_cast<float>(logarithm((level + 0.5) / (unit + 0.5))); }

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

struct Cell {
    std::uint16_t height, barrier;
};

// Writes the barrier of each pixel, the highest level where there is no start, and returns how many pixels have each.
// What lies no higher than the level that is worked on is next; the rest waits in the list of its own.
std::vector<std::size_t> barrier(const std::uint16_t* heights, const std::uint8_t* inside, Size size,
                                 std::uint16_t* out) {
    constexpr int kNone = -1;
    Bordered<Cell> cells(size, {0, 0});
    std::vector<int> first(kMaxLevel + 1, kNone), waiting(cells.count()), now;
    std::vector<std::size_t> pixels(first.size());
    cells.each([&](Cell& cell, std::size_t plain, int at) {
        cell = {heights[plain], inside[plain] != 0 ? std::uint16_t{0} : kUnseen};
        if (inside[plain] != 0) now.push_back(at);
    });
    const int steps[4] = {-cells.width(), -1, 1, cells.width()};
    for (std::size_t level = 0; level < first.size(); ++level) {
        for (int at = first[level]; at != kNone; at = waiting[static_cast<std::size_t>(at)]) now.push_back(at);
        while (!now.empty()) {
            const int at = now.back();
            now.pop_back();
            ++pixels[level];
            for (const int step : steps) {
                Cell& next = cells[at + step];
                if (next.barrier != kUnseen) continue;
                if (next.height <= level) {
                    next.barrier = static_cast<std::uint16_t>(level);
                    now.push_back(at + step);
                } else {
                    next.barrier = next.height;
                    waiting[static_cast<std::size_t>(at + step)] = first[next.height];
                    first[next.height] = at + step;
                }
            }
        }
    }
    cells.each([&](Cell cell, std::size_t plain, int) {
        if (cell.barrier == kUnseen) ++pixels[kMaxLevel];  // there is no start
        out[plain] = std::min(cell.barrier, static_cast<std::uint16_t>(kMaxLevel));
    });
    return pixels;
}

// Class of the logarithm of each level, ten classes a factor of e.
std::vector<std::size_t> classes() {
    std::vector<std::size_t> found(kMaxLevel + 1);
    for (std::size_t level = 0; level < found.size(); ++level)
        found[level] = static_cast<std::size_t>(10 * logarithm(2.0 * static_cast<double>(level) + 1));
    return found;
}

FFSEG_CLONES
void look_up(const float* table, const std::uint16_t* places, std::size_t count, float* out) {
    FFSEG_APART
    for (std::size_t i = 0; i < count; ++i) out[i] = table[static_cast<int>(places[i])];
}

// What is no number counts as 0.
FFSEG_CLONES
void step_all(const float* heights, std::size_t count, float scale, std::uint16_t* levels) {
    constexpr auto kMost = static_cast<float>(kMaxLevel);
    FFSEG_APART
    for (std::size_t i = 0; i < count; ++i) {
        const float level = heights[i] * scale + 0.5F, above = level > 0 ? level : 0;
        levels[i] = static_cast<std::uint16_t>(static_cast<int>(above < kMost ? above : kMost));
    }
}

}  // namespace

std::vector<std::uint16_t> stepped(const float* heights, std::size_t count, double step) {
    std::vector<std::uint16_t> levels(count);
    step_all(heights, count, static_cast<float>(1 / step), levels.data());
    return levels;
}

void barrier_planes(const float* heights, const std::uint8_t* inside, Size size, double step, float* out) {
    const std::size_t count = size.count();
    const std::vector<std::uint16_t> levels = stepped(heights, count, step);
    std::vector<std::uint16_t> barriers(count);
    const std::vector<std::size_t> pixels = barrier(levels.data(), inside, size, barriers.data());
    static const std::vector<std::size_t> class_of = classes();
    std::vector<std::size_t> alike(class_of.back() + 1);
    for (std::size_t level = 0; level < pixels.size(); ++level) alike[class_of[level]] += pixels[level];
    const double unit = median_inside(levels, inside), share = 1.0 / static_cast<double>(count);
    std::vector<float> tables(pixels.size() * kBarrierPlanes);
    float* table[kBarrierPlanes];
    for (std::size_t k = 0; k < kBarrierPlanes; ++k) table[k] = tables.data() + k * pixels.size();
    std::size_t below = 0;
    for (std::size_t level = 0; level < pixels.size(); ++level) {
        if (pixels[level] == 0) continue;
        below += pixels[level];
        table[0][level] = static_cast<float>(static_cast<double>(level) * step);
        table[1][level] = log_ratio(static_cast<double>(level), unit);
        table[2][level] = static_cast<float>(static_cast<double>(below) * share);
        table[3][level] = static_cast<float>(static_cast<double>(pixels[level]) * share);
        table[4][level] = static_cast<float>(static_cast<double>(alike[class_of[level]]) * share);
    }
    for (std::size_t k = 0; k < kBarrierPlanes; ++k) look_up(table[k], barriers.data(), count, out + k * count);
}

void geodesic(const float* heights, const std::uint8_t* inside, Size size, double step, int least, float* out) {
    const std::vector<std::uint16_t> levels = stepped(heights, size.count(), step);
    constexpr unsigned kStraight = 5, kSlanted = 7;
    constexpr unsigned kFar = std::numeric_limits<unsigned>::max();
    const auto highest = static_cast<std::size_t>(*std::max_element(levels.begin(), levels.end()));
    // the cost of a pixel is shared by the steps into it and out of it
    struct Cell {
        unsigned cost, own;
    };
    Bordered<Cell> cells(size, {0, 0});
    Buckets buckets(2 * (highest + static_cast<std::size_t>(least)) * kSlanted + 1, cells.count());
    cells.each([&](Cell& cell, std::size_t plain, int at) {
        cell = {inside[plain] != 0 ? 0 : kFar, levels[plain] + static_cast<unsigned>(least)};
        if (inside[plain] != 0) buckets.put(0, at);
    });
    const int row = cells.width();
    const int straight[4] = {-row, -1, 1, row}, slanted[4] = {-row - 1, -row + 1, row - 1, row + 1};
    buckets.empty([&](std::size_t cost, std::size_t place, int pixel) {
        const Cell here = cells[pixel];
        if (here.cost < cost) return;
        const auto reach = [&](int next, unsigned length) {
            Cell& cell = cells[next];
            const unsigned added = (here.own + cell.own) * length, sum = static_cast<unsigned>(cost) + added;
            if (sum >= cell.cost) return;
            cell.cost = sum;
            const std::size_t to = place + added;
            buckets.put(to < buckets.levels() ? to : to - buckets.levels(), next);
        };
        for (const int offset : straight) reach(pixel + offset, kStraight);
        for (const int offset : slanted) reach(pixel + offset, kSlanted);
    });
    const float scale = static_cast<float>(step / (2 * kStraight));
    cells.each([&](const Cell& cell, std::size_t plain, int) {
        out[plain] = cell.cost == kFar ? 0.0F : static_cast<float>(cell.cost) * scale;
    });
}

}  // namespace ffseg::evidence
