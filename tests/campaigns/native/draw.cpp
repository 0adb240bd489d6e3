#include "draw.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>

namespace fuzz {

using ffseg::Vec2;

Random::Random(std::uint64_t seed, std::uint64_t number) : state_(seed * 0x9e3779b97f4a7c15u) {
    state_ = bits() ^ number;
    bits();
}

std::uint64_t Random::bits() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

double Random::unit() { return static_cast<double>(bits() >> 11) * 0x1p-53; }

int Random::below(int count) { return static_cast<int>(bits() % static_cast<std::uint64_t>(count)); }

int Random::among(int low, int high) { return low + below(high - low + 1); }

double Random::scale(double low, double high) { return std::exp(between(std::log(low), std::log(high))); }

void expect(bool right, const char* sentence) {
    if (right) return;
    std::fprintf(stderr, "wrong result: %s\n", sentence);
    std::abort();
}

Size draw_size(Random& random, int shortest, int longest) {
    const auto turned = [&](int a, int b) { return random.once_in(2) ? Size{a, b} : Size{b, a}; };
    if (random.once_in(40)) return {shortest, shortest};
    if (random.once_in(30)) return turned(random.among(shortest, shortest + 1), random.among(shortest, 300));
    if (random.once_in(150)) {
        const int end = random.once_in(3) ? longest : static_cast<int>(random.scale(300, longest));
        return turned(random.among(shortest, shortest + 2), end);
    }
    if (random.once_in(4000)) return turned(random.among(300, 900), random.among(300, 1200));
    const int most = random.pick({6, 12, 24, 40});
    return {random.among(shortest, most), random.among(shortest, most)};
}

std::vector<std::uint8_t> draw_marks(Random& random, Size size) {
    std::vector<std::uint8_t> made(size.count());
    const std::uint8_t mark = random.once_in(6) ? 1 : 255;
    const int chance = random.pick({0, 0, 1, 20, 120, 240, 256});  // of 256
    if (chance == 256) std::fill(made.begin(), made.end(), mark);
    if (chance > 0 && chance < 256) {
        std::uint64_t word = 0;
        for (std::size_t i = 0; i < made.size(); ++i) {
            word = i % 8 == 0 ? random.bits() : word >> 8;
            if (static_cast<int>(word & 255) < chance) made[i] = mark;
        }
    }
    const std::size_t width = static_cast<std::size_t>(size.width);
    const auto row = [&](int y) {
        std::fill_n(made.begin() + static_cast<std::ptrdiff_t>(y) * size.width, width, mark);
    };
    const auto column = [&](int x) {
        for (std::size_t at = static_cast<std::size_t>(x); at < made.size(); at += width) made[at] = mark;
    };
    if (random.once_in(4)) row(random.below(size.height));
    if (random.once_in(4)) column(random.below(size.width));
    if (random.once_in(8)) {
        row(0);
        row(size.height - 1);
        column(0);
        column(size.width - 1);
    }
    if (random.once_in(4)) {  // a block of another value
        const int top = random.below(size.height), left = random.below(size.width);
        const int bottom = random.among(top, size.height - 1), right = random.among(left, size.width - 1);
        const std::uint8_t value = random.once_in(2) ? 0 : mark;
        for (int y = top; y <= bottom; ++y) {
            std::fill_n(made.begin() + static_cast<std::ptrdiff_t>(y) * size.width + left, right - left + 1, value);
        }
    }
    return made;
}

std::vector<std::uint8_t> draw_domain(Random& random, Size size) {
    return random.once_in(3) ? draw_marks(random, size) : std::vector<std::uint8_t>{};
}

std::vector<std::uint8_t> draw_bytes(Random& random, std::size_t count) {
    std::vector<std::uint8_t> made(count);
    const std::uint64_t mask =
        random.pick<std::uint64_t>({0, ~0ull, ~0ull, ~0ull, 0x0707070707070707u, 0x8080808080808080u});
    std::uint64_t word = 0;
    for (std::size_t i = 0; i < count; ++i) {
        word = i % 8 == 0 ? random.bits() & mask : word >> 8;
        made[i] = static_cast<std::uint8_t>(word);
    }
    return made;
}

std::vector<std::uint16_t> draw_gradient(Random& random, Size size) {
    std::vector<std::uint16_t> made(size.count());
    const int kind = random.below(6), ridge = random.below(size.width), slope = random.among(1, 4000);
    if (kind == 1) std::fill(made.begin(), made.end(), std::uint16_t{65535});
    if (kind < 2) return made;
    const std::uint64_t mask = random.pick<std::uint64_t>({0xffff, 0xffff, 0x3f, 1});
    for (std::size_t i = 0; i < made.size(); ++i) {
        const int x = static_cast<int>(i % static_cast<std::size_t>(size.width));
        const int ramp = std::max(0, 65535 - slope * std::abs(x - ridge));
        made[i] = kind < 4 ? static_cast<std::uint16_t>(random.bits() & mask) : static_cast<std::uint16_t>(ramp);
    }
    return made;
}

double hostile(Random& random, double limit) {
    constexpr double kTiny = std::numeric_limits<double>::denorm_min();
    const double value =
        random.pick({0.0, -0.0, kTiny, 1e-300, 0.5, 0.5 - 1e-6, -0.5, 65534.5, 65535.5, 1e6, 1e9, 2147483647.0,
                     2147483648.0, 9.3e18, 1e100, 1e154, 1e300, std::numeric_limits<double>::max()});
    return (random.once_in(2) ? -1.0 : 1.0) * std::min(value, limit);
}

namespace {

Vec2 on_frame(Size size, double share) {  // once round the border of a map
    const double w = size.width - 1.0, h = size.height - 1.0, way = share * 4.0;
    if (way < 1) return {way * w, 0.0};
    if (way < 2) return {w, (way - 1) * h};
    if (way < 3) return {(3 - way) * w, h};
    return {0.0, (4 - way) * h};
}

void spoil(Random& random, double limit, std::vector<Vec2>& points) {
    const int count = static_cast<int>(points.size());
    const auto any = [&]() -> Vec2& { return points[static_cast<std::size_t>(random.below(count))]; };
    if (random.once_in(4)) any() = any();
    if (random.once_in(4)) {
        const std::size_t at = static_cast<std::size_t>(random.below(count));
        points[(at + 1) % points.size()] = points[at];
    }
    if (random.once_in(4)) {
        for (Vec2& p : points) p = {std::round(p.x), std::round(p.y)};
    }
    if (random.once_in(12)) {
        for (int i = random.among(1, 3); i > 0; --i) {
            Vec2& p = any();
            if (!random.once_in(3)) p.x = hostile(random, limit);
            if (!random.once_in(3)) p.y = hostile(random, limit);
        }
    }
    if (random.once_in(100)) {
        const double factor = random.scale(1e-300, std::min(limit, 1e300));
        for (Vec2& p : points) p = factor * p;
    }
    for (Vec2& p : points) p = {std::clamp(p.x, -limit, limit), std::clamp(p.y, -limit, limit)};
}

}  // namespace

std::vector<Vec2> draw_points(Random& random, Size size, int count, double limit) {
    constexpr double kTurn = 6.283185307179586;
    const int kind = random.below(10);
    const Vec2 middle{random.between(-1, size.width), random.between(-1, size.height)};
    const double largest = std::max(size.width, size.height), radius = random.scale(0.01, 2 * largest + 1);
    const double turn = kTurn * random.pick({1, 1, 1, -1, 2}), noise = random.once_in(2) ? 0.0 : 0.4;
    const Vec2 along{random.between(-radius, radius), random.between(-radius, radius)};
    std::vector<Vec2> points;
    for (int i = 0; i < count; ++i) {
        const double share = static_cast<double>(i) / count, r = radius * (1 + noise * random.between(-1, 1));
        const double angle = turn * share;
        const Vec2 circle{std::cos(angle), std::sin(angle)};
        if (kind < 5) points.push_back(middle + r * circle);
        if (kind == 5) points.push_back(middle + share * along);
        if (kind == 6) points.push_back(middle);
        if (kind == 7) points.push_back({random.between(-2, size.width + 1.0), random.between(-2, size.height + 1.0)});
        if (kind == 8) points.push_back(on_frame(size, turn > 0 ? share : 1 - share));
        if (kind == 9) points.push_back(middle + Vec2{r * circle.x, r * std::sin(2 * angle)});
    }
    if (count > 0) spoil(random, limit, points);
    return points;
}

}  // namespace fuzz
