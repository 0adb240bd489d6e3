// Logarithms and exponentials by basic operations alone, which round alike on every processor.
#pragma once
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>

#include "common/lanes.hpp"
#include "evidence/plane.hpp"

namespace ffseg::evidence {

// log x = e log 2 + log m, with m from sqrt(1/2) to sqrt(2), and log m = 2 (s + s^3 / 3 + s^5 / 5 + ...) of
// s = (m - 1) / (m + 1), which is at most 0.172: what is left out is below the rounding of a Number.
template <class Number>
FFSEG_PART inline Number logarithm(Number value) {
    constexpr bool kSingle = std::is_same_v<Number, float>;
    using Bits = std::conditional_t<kSingle, std::int32_t, std::int64_t>;
    constexpr auto kRootOfHalf = static_cast<Bits>(kSingle ? 0x3f3504f3 : 0x3fe6a09e667f3bcd);
    constexpr int kMantissa = std::numeric_limits<Number>::digits - 1, kLast = kSingle ? 9 : 21;
    Bits bits;
    std::memcpy(&bits, &value, sizeof bits);
    const Bits exponent = (bits - kRootOfHalf) >> kMantissa;
    bits -= exponent * (Bits{1} << kMantissa);
    Number m;
    std::memcpy(&m, &bits, sizeof m);
    const Number s = (m - 1) / (m + 1), square = s * s;
    Number sum = 0;
    for (int odd = kLast; odd >= 1; odd -= 2) sum = sum * square + Number{1} / static_cast<Number>(odd);
    return static_cast<Number>(exponent) * static_cast<Number>(0.69314718055994530942) + 2 * s * sum;
}

// e^x = 2^k e^r, with r from -log(2) / 2 to log(2) / 2, and e^r = 1 + r + r^2 / 2 + ... + r^7 / 7!: what is left out is
// below the rounding of a float. Exponents beyond 87 either way, whose results few floats hold, count as 87.
FFSEG_PART inline float exponential(float value) {
    constexpr float kMost = 87.0F, kPerHalving = 1.44269504F, kHigh = 0.693145752F, kLow = 1.42860682e-6F;
    const float x = std::min(std::max(value, -kMost), kMost), scaled = x * kPerHalving;
    const auto k = static_cast<std::int32_t>(scaled + (scaled < 0 ? -0.5F : 0.5F));
    const auto halvings = static_cast<float>(k);
    const float r = (x - halvings * kHigh) - halvings * kLow;
    constexpr float kFactors[] = {1.0F, 1.0F, 1 / 2.0F, 1 / 6.0F, 1 / 24.0F, 1 / 120.0F, 1 / 720.0F, 1 / 5040.0F};
    float sum = 0;
    for (int degree = 7; degree >= 0; --degree) sum = sum * r + kFactors[degree];
    const std::int32_t bits = (k + 127) * (1 << 23);
    float power;
    std::memcpy(&power, &bits, sizeof power);
    return sum * power;
}

void logarithms(const float* values, std::size_t count, float* out);
void exponentials(const float* values, std::size_t count, float* out);

}  // namespace ffseg::evidence
