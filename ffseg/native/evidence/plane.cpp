#include "evidence/plane.hpp"

#include <algorithm>
#include <cmath>

#include "common/lanes.hpp"

namespace ffseg::evidence {
namespace {

FFSEG_CLONES
void every_second(const float* row, float* out, int count) {
    FFSEG_APART
    for (int x = 0; x < count; ++x) out[x] = row[2 * x];
}

FFSEG_CLONES
void larger_of_rows(const float* a, const float* b, float* out, int count) {
    FFSEG_APART
    for (int x = 0; x < count; ++x) out[x] = std::max(a[x], b[x]);
}

FFSEG_CLONES
void larger_of_pairs(const float* row, float* out, int count) {
    FFSEG_APART
    for (int x = 0; x < count; ++x) out[x] = std::max(row[2 * x], row[2 * x + 1]);
}

FFSEG_CLONES
void between_rows(const float* before, const float* after, float share, float* out, int count) {
    const float rest = 1.0F - share;
    FFSEG_APART
    for (int x = 0; x < count; ++x) out[x] = before[x] * rest + after[x] * share;
}

// The values before and after a pixel of a longer line, and the weight of the one after.
struct Between {
    int before, after;
    float share;
};

std::vector<Between> places_between(int length, int values, double step, int stride) {
    std::vector<Between> places(static_cast<std::size_t>(length));
    for (int i = 0; i < length; ++i) {
        const double at = std::clamp(((i + 0.5) / step - 0.5) / stride, 0.0, values - 1.0);
        const int before = std::min(static_cast<int>(at), values - 1);
        places[static_cast<std::size_t>(i)] = {before, std::min(before + 1, values - 1),
                                               static_cast<float>(at - before)};
    }
    return places;
}

}  // namespace

FFSEG_CLONES
bool within(const float* values, std::size_t count, float most) {
    int beyond = 0;
    FFSEG_APART
    for (std::size_t i = 0; i < count; ++i) beyond |= !(std::abs(values[i]) <= most);
    return beyond == 0;
}

void thin(const float* plane, Size size, float* out) {
    const Size small = halved(size);
    for (int y = 0; y < small.height; ++y) {
        every_second(plane + 2 * static_cast<std::ptrdiff_t>(y) * size.width,
                     out + static_cast<std::ptrdiff_t>(y) * small.width, small.width);
    }
}

void steepest(const float* plane, Size size, float* out) {
    const Size small = halved(size);
    Plane larger(static_cast<std::size_t>(size.width));
    for (int y = 0; y < small.height; ++y) {
        const float* row = plane + 2 * static_cast<std::ptrdiff_t>(y) * size.width;
        float* to = out + static_cast<std::ptrdiff_t>(y) * small.width;
        const float* below = 2 * y + 1 < size.height ? row + size.width : row;
        larger_of_rows(row, below, larger.data(), size.width);
        larger_of_pairs(larger.data(), to, size.width / 2);
        if (size.width % 2 != 0) to[small.width - 1] = larger.back();
    }
}

void enlarge(const float* plane, Size size, const Enlargement& how, float* out) {
    const std::vector<Between> right = places_between(how.size.width, size.width, how.factor, how.stride);
    const std::vector<Between> down = places_between(how.size.height, size.height, how.factor, how.stride);
    const auto width = static_cast<std::size_t>(how.size.width);
    Plane wide(width * static_cast<std::size_t>(size.height));
    for (int y = 0; y < size.height; ++y) {
        const float* row = plane + static_cast<std::ptrdiff_t>(y) * size.width;
        float* to = wide.data() + static_cast<std::size_t>(y) * width;
        for (const Between& at : right) *to++ = row[at.before] * (1.0F - at.share) + row[at.after] * at.share;
    }
    for (const Between& at : down) {
        const float* before = wide.data() + static_cast<std::size_t>(at.before) * width;
        const float* after = wide.data() + static_cast<std::size_t>(at.after) * width;
        between_rows(before, after, at.share, out, how.size.width);
        out += width;
    }
}

}  // namespace ffseg::evidence
