// Images as the core looks at them.
#pragma once
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "common/vec.hpp"

namespace ffseg {

constexpr std::size_t kMaxSide = 65535;  // places along a side are 16-bit numbers
constexpr int kMaxChannels = 3;

struct Size {
    int height = 0, width = 0;
    std::size_t count() const { return static_cast<std::size_t>(height) * static_cast<std::size_t>(width); }
};

// Rows of `channels` bytes a pixel, kept by their owner; no pixels stand for no image.
struct Picture {
    const std::uint8_t* pixels = nullptr;
    int height = 0, width = 0, channels = 0;
};

// Calls one of its three forms by the number of channels.
template <typename Visit>
FFSEG_INLINE auto by_channels(int channels, Visit visit) {
    if (channels == 3) return visit(std::integral_constant<int, 3>{});
    if (channels == 1) return visit(std::integral_constant<int, 1>{});
    return visit(std::integral_constant<int, 2>{});
}

}  // namespace ffseg
