// Points, vectors and boxes in pixels: x right, y down, integers at pixel centres.
#pragma once
#include <algorithm>
#include <cmath>
#include <limits>

// FFSEG_PLAIN leaves all that only some compilers know out, so that any compiler can build and try what MSVC builds.
#if defined(__GNUC__) && !defined(FFSEG_PLAIN)
#define FFSEG_GNU
#endif

#if defined(FFSEG_GNU) && defined(__SSE2__)
#include <emmintrin.h>
#endif

// Small functions in the innermost loops, which compilers leave out of line when they are called often.
#if defined(FFSEG_GNU)
#define FFSEG_INLINE inline __attribute__((always_inline))
#elif defined(_MSC_VER)
#define FFSEG_INLINE __forceinline
#else
#define FFSEG_INLINE inline
#endif

namespace ffseg {

struct Vec2 {
    double x = 0.0, y = 0.0;
};

inline Vec2 operator+(Vec2 a, Vec2 b) { return {a.x + b.x, a.y + b.y}; }
inline Vec2 operator-(Vec2 a, Vec2 b) { return {a.x - b.x, a.y - b.y}; }
inline Vec2 operator*(double s, Vec2 a) { return {s * a.x, s * a.y}; }
inline Vec2& operator+=(Vec2& a, Vec2 b) { return a = a + b; }
inline double dot(Vec2 a, Vec2 b) { return a.x * b.x + a.y * b.y; }
// Positive when b lies clockwise of a on the screen (counter-clockwise in these y-down axes).
inline double cross(Vec2 a, Vec2 b) { return a.x * b.y - a.y * b.x; }
inline double norm2(Vec2 a) { return dot(a, a); }
FFSEG_INLINE double norm(Vec2 a) { return std::sqrt(norm2(a)); }
// The vector scaled to length 1; the zero vector stays.
FFSEG_INLINE Vec2 unit(Vec2 a) {
    const double size = norm(a);
    return size > 0 ? (1.0 / size) * a : Vec2{};
}

struct Box {
    double x0 = std::numeric_limits<double>::infinity(), y0 = x0, x1 = -x0, y1 = -x0;

    void add(Vec2 p) {
        x0 = std::min(x0, p.x);
        y0 = std::min(y0, p.y);
        x1 = std::max(x1, p.x);
        y1 = std::max(y1, p.y);
    }
    bool holds(Vec2 p) const { return x0 <= p.x && p.x <= x1 && y0 <= p.y && p.y <= y1; }
    bool meets(const Box& other) const {
#if defined(FFSEG_GNU) && defined(__SSE2__)  // two sides at a time, as they lie
        const __m128d before = _mm_cmple_pd(_mm_loadu_pd(&x0), _mm_loadu_pd(&other.x1));
        const __m128d after = _mm_cmple_pd(_mm_loadu_pd(&other.x0), _mm_loadu_pd(&x1));
        return _mm_movemask_pd(_mm_and_pd(before, after)) == 3;
#else
        return (x0 <= other.x1) & (other.x0 <= x1) & (y0 <= other.y1) & (other.y0 <= y1);  // without branches
#endif
    }
};

static_assert(sizeof(Box) == 4 * sizeof(double));

inline Box joined(Box a, const Box& b) {
    a.add({b.x0, b.y0});
    a.add({b.x1, b.y1});
    return a;
}

// Does the segment ab cross the ray from p to the right? Counting these tells what lies inside a polygon.
inline bool passes_right_of(Vec2 p, Vec2 a, Vec2 b) {
    return (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x);
}

// Do the segments ab and cd cross at a point inside both? Touching and collinear segments do not count.
inline bool segments_cross(Vec2 a, Vec2 b, Vec2 c, Vec2 d) {
    const Vec2 ab = b - a, cd = d - c;
    const double c1 = cross(ab, c - a), d1 = cross(ab, d - a);
    if ((c1 > 0) == (d1 > 0) || c1 == 0 || d1 == 0) return false;
    const double a1 = cross(cd, a - c), b1 = cross(cd, b - c);
    return (a1 > 0) != (b1 > 0) && a1 != 0 && b1 != 0;
}

}  // namespace ffseg
