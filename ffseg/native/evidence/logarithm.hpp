// Natural logarithms of positive numbers, by basic operations alone, which round alike on every processor.
#pragma once
#include <cstdint>
#include <cstring>

#include "evidence/plane.hpp"

namespace ffseg::evidence {

// log x = e log 2 + log m, with m from sqrt(1/2) to sqrt(2), and log m = 2 (s + s^3 / 3 + s^5 / 5 + ...) of
// s = (m - 1) / (m + 1), which is at most 0.172: what is left out is below the rounding of a double.
inline double logarithm(double value) {
    constexpr std::uint64_t kRootOfHalf = 0x3fe6a09e667f3bcd;
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    const auto exponent = static_cast<std::int64_t>(bits - kRootOfHalf) >> 52;
    bits -= static_cast<std::uint64_t>(exponent) << 52;
    double m;
    std::memcpy(&m, &bits, sizeof m);
    const double s = (m - 1) / (m + 1), square = s * s;
    double sum = 0;
    for (int odd = 21; odd >= 1; odd -= 2) sum = sum * square + 1.0 / odd;
    return static_cast<double>(exponent) * 0.69314718055994530942 + 2 * s * sum;
}

// Of each value of a plane, in single precision: 1e-7 of the result, or of one where that is smaller.
void logarithms(const float* values, std::size_t count, float* out);

}  // namespace ffseg::evidence
