#include "evidence/diffuse.hpp"

#include <cmath>

namespace ffseg::evidence {
namespace {

// Weight between a pixel and the one `step` further on.
float weight(const float* lab, std::size_t count, std::size_t at, std::size_t step, float falloff) {
    float squares = 0;
    for (std::size_t c = 0; c < 3; ++c) {
        const float apart = lab[c * count + at + step] - lab[c * count + at];
        squares += apart * apart;
    }
    return std::exp(-squares * falloff);
}

// Weights towards the right and the lower neighbour, with a border of zeros so that every pixel has four; and one over
// the sum of all.
struct Weights {
    std::size_t width;  // of a row with its border: a column before and one behind
    Plane right, down, inverse;

    Weights(const float* lab, Size size, const Diffusion& how)
        : width(static_cast<std::size_t>(size.width) + 2),
          right(width * (static_cast<std::size_t>(size.height) + 2)),
          down(right.size()),
          inverse(right.size()) {
        const auto falloff = static_cast<float>(0.5 / (how.contrast * how.contrast));
        const auto columns = static_cast<std::size_t>(size.width), rows = static_cast<std::size_t>(size.height);
        for (std::size_t y = 0; y < rows; ++y) {
            for (std::size_t x = 0; x < columns; ++x) {
                const std::size_t from = y * columns + x, to = (y + 1) * width + x + 1;
                if (x + 1 < columns) right[to] = weight(lab, size.count(), from, 1, falloff);
                if (y + 1 < rows) down[to] = weight(lab, size.count(), from, columns, falloff);
            }
        }
        for (std::size_t at = width + 1; at < (rows + 1) * width; ++at) {
            inverse[at] =
                1 / (static_cast<float>(how.kept) + right[at] + right[at - 1] + down[at] + down[at - width]);
        }
    }
};

void step_row(const Weights& by, const float* own, const float* from, std::size_t begin, std::size_t end, float* to) {
    const float *right = by.right.data(), *down = by.down.data(), *inverse = by.inverse.data();
    const std::size_t width = by.width;
    for (std::size_t at = begin; at < end; ++at) {
        to[at] = (own[at] + right[at] * from[at + 1] + right[at - 1] * from[at - 1] + down[at] * from[at + width] +
                  down[at - width] * from[at - width]) *
                 inverse[at];
    }
}

}  // namespace

void diffuse(const float* values, const float* lab, Size size, const Diffusion& how, float* out) {
    const Weights by(lab, size, how);
    Plane own(by.right.size()), from(own.size()), to(own.size());
    const auto columns = static_cast<std::size_t>(size.width), rows = static_cast<std::size_t>(size.height);
    for (std::size_t y = 0; y < rows; ++y) {
        for (std::size_t x = 0; x < columns; ++x) {
            const std::size_t at = (y + 1) * by.width + x + 1;
            from[at] = values[y * columns + x];
            own[at] = static_cast<float>(how.kept) * from[at];
        }
    }
    for (int step = 0; step < how.steps; ++step) {
        for (std::size_t y = 1; y <= rows; ++y) {
            step_row(by, own.data(), from.data(), y * by.width + 1, y * by.width + 1 + columns, to.data());
        }
        from.swap(to);
    }
    for (std::size_t y = 0; y < rows; ++y) {
        for (std::size_t x = 0; x < columns; ++x) out[y * columns + x] = from[(y + 1) * by.width + x + 1];
    }
}

}  // namespace ffseg::evidence
