// What the native fuzzing draws: numbers at and between their limits, sizes, maps, points and contours.
#pragma once
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <vector>

#include "common/vec.hpp"

namespace fuzz {

// The same numbers for the same seed and case on every machine (splitmix64).
class Random {
public:
    Random(std::uint64_t seed, std::uint64_t number);

    std::uint64_t bits();
    double unit();                    // [0, 1)
    int below(int count);             // 0 .. count - 1
    int among(int low, int high);     // low .. high
    bool once_in(int count) { return below(count) == 0; }
    double between(double low, double high) { return low + (high - low) * unit(); }
    double scale(double low, double high);  // evenly on a logarithmic scale
    template <class T>
    T pick(std::initializer_list<T> values) {
        return values.begin()[below(static_cast<int>(values.size()))];
    }

private:
    std::uint64_t state_;
};

// Ends the process with a sentence when a result cannot be right.
void expect(bool right, const char* sentence);

// Height and width: mostly small, now and then one pixel, a strip, a strip up to `longest`, a large map.
struct Size {
    int height, width;
    std::size_t count() const { return static_cast<std::size_t>(height) * static_cast<std::size_t>(width); }
};
Size draw_size(Random& random, int shortest, int longest);

// Edge, domain or inside map: empty, full, scattered, lines, a frame, a block. Vectors end where the map does, so that
// the sanitizer sees every step beyond.
std::vector<std::uint8_t> draw_marks(Random& random, Size size);
// A domain, or nothing, which stands for none.
std::vector<std::uint8_t> draw_domain(Random& random, Size size);
inline const std::uint8_t* or_null(const std::vector<std::uint8_t>& plane) {
    return plane.empty() ? nullptr : plane.data();
}
std::vector<std::uint8_t> draw_bytes(Random& random, std::size_t count);
// Gradients: noise, zero, the largest, ramps, ridges.
std::vector<std::uint16_t> draw_gradient(Random& random, Size size);

// A coordinate of any kind with |value| <= limit.
double hostile(Random& random, double limit);
// Points in and round a map: circles, lines, one place, noise, the frame, loops; repeated, rounded, far away.
std::vector<ffseg::Vec2> draw_points(Random& random, Size size, int count, double limit);

}  // namespace fuzz
