#include "evidence/elementary.hpp"

namespace ffseg::evidence {

FFSEG_CLONES
void logarithms(const float* values, std::size_t count, float* out) {
    FFSEG_APART
    for (std::size_t i = 0; i < count; ++i) out[i] = logarithm(values[i]);
}

FFSEG_CLONES
void exponentials(const float* values, std::size_t count, float* out) {
    FFSEG_APART
    for (std::size_t i = 0; i < count; ++i) out[i] = exponential(values[i]);
}

}  // namespace ffseg::evidence
