// How the loops over rows of pixels are compiled: plain C++, and where the compiler can, an AVX2 version beside the
// portable one, picked at load time. Results are the same: only exact integer arithmetic and correctly rounded square
// roots or single multiplications and additions (never contracted) are used.
#pragma once

#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__)
#define FFSEG_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define FFSEG_CLONES
#endif

// What a cloned loop calls must become part of it, else it is compiled once, for the portable version only.
#if defined(__GNUC__)
#define FFSEG_PART __attribute__((always_inline))
#else
#define FFSEG_PART
#endif

// Before a loop: what it writes, no later turn reads.
#if defined(__clang__)
#define FFSEG_APART _Pragma("clang loop vectorize(assume_safety)")
#elif defined(__GNUC__)
#define FFSEG_APART _Pragma("GCC ivdep")
#else
#define FFSEG_APART
#endif
