// Work side by side. Loops over rows of pixels are plain C++, and where the compiler can, versions for AVX2 and AVX-512
// stand beside the portable one, picked at load time. Results are the same: only exact integer arithmetic and correctly
// rounded square roots or single multiplications and additions (never contracted) are used. Few numbers at a time go
// into a Float4.
#pragma once
#include "common/vec.hpp"

#if defined(FFSEG_GNU) && defined(__SSE__)
#include <xmmintrin.h>
#endif

#if defined(FFSEG_GNU) && !defined(__clang__) && defined(__x86_64__) && defined(__gnu_linux__) && \
    !defined(__SANITIZE_ADDRESS__)
#define FFSEG_CLONES __attribute__((target_clones("arch=x86-64-v4", "avx2", "default")))
#else
#define FFSEG_CLONES
#endif

// What a cloned loop calls must become part of it, else it is compiled once, for the portable version only.
#if defined(FFSEG_GNU)
#define FFSEG_PART __attribute__((always_inline))
#else
#define FFSEG_PART
#endif

// Before a loop: what it writes, no later turn reads.
#if defined(FFSEG_GNU) && defined(__clang__)
#define FFSEG_APART _Pragma("clang loop vectorize(assume_safety)")
#elif defined(FFSEG_GNU)
#define FFSEG_APART _Pragma("GCC ivdep")
#else
#define FFSEG_APART
#endif

// Fetches what will be read soon, so that several places come from memory at once.
#if defined(FFSEG_GNU)
#define FFSEG_PREFETCH(at) __builtin_prefetch(at)
#else
#define FFSEG_PREFETCH(at) static_cast<void>(at)
#endif

namespace ffseg {

// Four numbers that are worked on side by side.
#if defined(FFSEG_GNU)
using Float4 = float __attribute__((vector_size(16)));
using Int4 = int __attribute__((vector_size(16)));

#if defined(__SSE__)  // GCC makes four instructions of the choice where b is a constant
FFSEG_INLINE Float4 smaller(Float4 a, Float4 b) { return _mm_min_ps(a, b); }
FFSEG_INLINE Float4 larger(Float4 a, Float4 b) { return _mm_max_ps(a, b); }
#else
FFSEG_INLINE Float4 smaller(Float4 a, Float4 b) { return a < b ? a : b; }
FFSEG_INLINE Float4 larger(Float4 a, Float4 b) { return a > b ? a : b; }
#endif
FFSEG_INLINE Int4 truncated(Float4 a) { return __builtin_convertvector(a, Int4); }
#else
template <typename Number>
struct Four {
    Number at[4];
    Number& operator[](int i) { return at[i]; }
    const Number& operator[](int i) const { return at[i]; }
};
using Float4 = Four<float>;
using Int4 = Four<int>;

template <typename Make>
inline Float4 four(Make make) {
    return {{make(0), make(1), make(2), make(3)}};
}
inline Float4 operator+(const Float4& a, const Float4& b) {
    return four([&](int i) { return a[i] + b[i]; });
}
inline Float4 operator-(const Float4& a, const Float4& b) {
    return four([&](int i) { return a[i] - b[i]; });
}
inline Float4 operator*(const Float4& a, const Float4& b) {
    return four([&](int i) { return a[i] * b[i]; });
}
inline Float4 operator+(const Float4& a, float b) {
    return four([&](int i) { return a[i] + b; });
}
inline Float4 operator*(const Float4& a, float b) {
    return four([&](int i) { return a[i] * b; });
}
inline Float4 smaller(const Float4& a, const Float4& b) {
    return four([&](int i) { return a[i] < b[i] ? a[i] : b[i]; });
}
inline Float4 larger(const Float4& a, const Float4& b) {
    return four([&](int i) { return a[i] > b[i] ? a[i] : b[i]; });
}
inline Int4 truncated(const Float4& a) {
    return {{static_cast<int>(a[0]), static_cast<int>(a[1]), static_cast<int>(a[2]), static_cast<int>(a[3])}};
}
#endif

FFSEG_INLINE Float4 all(float value) { return Float4{value, value, value, value}; }

}  // namespace ffseg
