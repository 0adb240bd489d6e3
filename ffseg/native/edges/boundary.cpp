#include "edges/boundary.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "common/measures.hpp"

namespace ffseg::edges {
namespace {

// Whether a pixel outside the domain lies `margin` pixels beside the point, or at it; at the image's border, there.
bool near_outside(Vec2 at, const Limits& limits) {
    for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
            const double x = std::clamp(at.x + dx * limits.margin, 0.0, limits.width - 1.0);
            const double y = std::clamp(at.y + dy * limits.margin, 0.0, limits.height - 1.0);
            const auto row = static_cast<std::size_t>(std::rint(y)), column = static_cast<std::size_t>(std::rint(x));
            if (limits.domain[row * static_cast<std::size_t>(limits.width) + column] == 0) return true;
        }
    }
    return false;
}

bool within(Vec2 at, const Limits& limits) {
    const double least = limits.margin, right = limits.width - 1.0 - least, bottom = limits.height - 1.0 - least;
    if (at.x < least || at.y < least || at.x > right || at.y > bottom) return true;
    return limits.domain != nullptr && near_outside(at, limits);
}

struct Offset {
    int dx, dy, squared;
};

// Steps to pixels nearer than the last level's distance, farthest first: beside a long boundary these soon leave the
// region.
std::vector<Offset> offsets_below(int most) {
    const int reach = static_cast<int>(std::sqrt(most));
    std::vector<Offset> found;
    for (int dy = -reach; dy <= reach; ++dy) {
        for (int dx = -reach; dx <= reach; ++dx) {
            const int squared = dx * dx + dy * dy;
            if (squared > 0 && squared < most) found.push_back({dx, dy, squared});
        }
    }
    std::stable_sort(found.begin(), found.end(),
                     [](const Offset& a, const Offset& b) { return a.squared > b.squared; });
    return found;
}

// The first place from `at` on that is marked with 1; the length if none is.
std::size_t next(const std::vector<std::uint8_t>& marks, std::size_t at) {
    if (at >= marks.size()) return marks.size();
    const void* found = std::memchr(marks.data() + at, 1, marks.size() - at);
    if (found == nullptr) return marks.size();
    return static_cast<std::size_t>(static_cast<const std::uint8_t*>(found) - marks.data());
}

// Whether no pixel of these offsets, from this one on, lies outside a region.
bool is_deep(const std::uint8_t* region, Size size, int x, int y, const Offset* begin, const Offset* end) {
    return std::all_of(begin, end, [&](const Offset& to) {
        const int column = x + to.dx, row = y + to.dy;
        if (column < 0 || row < 0 || column >= size.width || row >= size.height) return true;
        return region[static_cast<std::size_t>(row) * static_cast<std::size_t>(size.width) + column] != 0;
    });
}

}  // namespace

double lively_share(const std::uint8_t* region, const std::uint16_t* gradient, Size size, const Lively& asked) {
    const auto width = static_cast<std::size_t>(size.width);
    const int far = static_cast<int>(asked.count) - 1;
    const auto noise = static_cast<std::uint16_t>(std::clamp(std::floor(asked.levels[far]), 0.0, 65535.0));
    const double* end = asked.levels + asked.count;
    const std::vector<Offset> offsets = offsets_below(far);
    std::vector<const Offset*> nearer;  // for each squared distance, the first of the offsets below it
    for (int squared = 0; squared <= std::max(far, 2); ++squared) {
        const auto is_farther = [&](const Offset& to) { return to.squared >= squared; };
        nearer.push_back(offsets.data() +
                         (std::partition_point(offsets.begin(), offsets.end(), is_farther) - offsets.begin()));
    }
    std::vector<std::uint8_t> seen(width);
    std::size_t area = 0, lively = 0;
    for (int y = 0; y < size.height; y += asked.step) {
        const std::uint8_t* row = region + static_cast<std::size_t>(y) * width;
        area += width - static_cast<std::size_t>(std::count(row, row + width, std::uint8_t{0}));
    }
    for (int y = 0; y < size.height; y += asked.step) {
        const std::size_t begin = static_cast<std::size_t>(y) * width;
        const std::uint16_t* levels = gradient + begin;
        const std::uint8_t* row = region + begin;
        for (std::size_t x = 0; x < width; ++x)
            seen[x] = static_cast<std::uint8_t>((levels[x] > noise) & (row[x] != 0));
        for (std::size_t x = next(seen, 0); x < width; x = next(seen, x + 1)) {
            const double own = levels[x];
            const auto* below = std::partition_point(asked.levels, end, [&](double level) { return level >= own; });
            const int squared = std::max(2, static_cast<int>(below - asked.levels));
            lively += is_deep(region, size, static_cast<int>(x), y, nearer[squared], offsets.data() + offsets.size());
        }
        if (static_cast<double>(lively) > asked.most * static_cast<double>(area)) return 1.0;
    }
    return area > 0 ? static_cast<double>(lively) / static_cast<double>(area) : 0.0;
}

std::vector<std::uint16_t> gradients_at(const std::vector<Vec2>& joints, const std::uint16_t* gradient,
                                        const Limits& limits) {
    const auto width = static_cast<std::size_t>(limits.width);
    std::vector<std::uint16_t> found;
    for (const Vec2 joint : joints) {
        const Vec2 at{std::rint(joint.x), std::rint(joint.y)};
        if (within(at, limits)) continue;
        const std::uint16_t* row = gradient + (static_cast<std::size_t>(at.y) - 1) * width;
        row += static_cast<std::size_t>(at.x) - 1;
        std::uint16_t most = 0;
        for (int dy = 0; dy < 3; ++dy, row += width) most = std::max({most, row[0], row[1], row[2]});
        found.push_back(most);
    }
    return found;
}

double share_within(const std::vector<Vec2>& joints, const std::vector<std::size_t>& ends, const Limits& limits) {
    if (std::none_of(joints.begin(), joints.end(), [&](Vec2 at) { return within(at, limits); })) return 0.0;
    double along = 0.0, whole = 0.0;
    std::vector<double> lengths, inside;
    for (std::size_t c = 1; c < ends.size(); ++c) {
        lengths.clear();
        inside.clear();
        for (std::size_t i = ends[c - 1]; i < ends[c]; ++i) {
            const std::size_t next = i + 1 < ends[c] ? i + 1 : ends[c - 1];
            const Vec2 step = joints[next] - joints[i];
            lengths.push_back(std::hypot(step.x, step.y));
            if (within(joints[i], limits) && within(joints[next], limits)) inside.push_back(lengths.back());
        }
        along += pairwise_sum(inside.data(), inside.size());
        whole += pairwise_sum(lengths.data(), lengths.size());
    }
    return whole > 0 ? along / whole : 0.0;
}

}  // namespace ffseg::edges
