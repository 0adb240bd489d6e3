// Planes of float32 features, one value a pixel, row by row.
#pragma once
#include <cstddef>
#include <vector>

namespace ffseg::evidence {

struct Size {
    int height = 0, width = 0;
    std::size_t count() const { return static_cast<std::size_t>(height) * static_cast<std::size_t>(width); }
};

using Plane = std::vector<float>;

}  // namespace ffseg::evidence
