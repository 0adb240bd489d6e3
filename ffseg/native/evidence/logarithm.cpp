#include "evidence/logarithm.hpp"

#include "common/lanes.hpp"

namespace ffseg::evidence {

// As `logarithm`, side by side; log 2 in two parts, of which the first times an exponent is exact.
FFSEG_CLONES
void logarithms(const float* values, std::size_t count, float* out) {
    constexpr std::int32_t kRootOfHalf = 0x3f3504f3;
    FFSEG_APART
    for (std::size_t i = 0; i < count; ++i) {
        std::int32_t bits;
        std::memcpy(&bits, values + i, sizeof bits);
        const std::int32_t exponent = (bits - kRootOfHalf) >> 23;
        bits -= exponent * (1 << 23);
        float m;
        std::memcpy(&m, &bits, sizeof m);
        const float s = (m - 1) / (m + 1), square = s * s, e = static_cast<float>(exponent);
        const float series = 2 + square * (2.0F / 3 + square * (2.0F / 5 + square * (2.0F / 7 + square * (2.0F / 9))));
        out[i] = e * 0.693145752F + (e * 1.42860677e-6F + s * series);
    }
}

}  // namespace ffseg::evidence
