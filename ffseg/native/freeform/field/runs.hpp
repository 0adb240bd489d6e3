// Rows of pixels in runs, eight of which are looked at as one number.
#pragma once
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "common/lanes.hpp"
#include "freeform/field/cells.hpp"

namespace ffseg::field {

// Pixels looked at together.
constexpr int kRun = 64;

// Eight pixels, a byte each, as one number.
using Eight = std::uint64_t;
constexpr int kEight = 8;
constexpr Eight kOnes = 0x0101010101010101;

FFSEG_INLINE Eight eight(const std::uint8_t* bytes) {
    Eight read = 0;
    std::memcpy(&read, bytes, sizeof read);
    return read;
}

// Which runs of each row hold something blocked; none do above and below the image.
struct RunMarks {
    RunMarks(int height, std::size_t runs)
        : stride((runs + kEight - 1) / kEight * kEight), marks((static_cast<std::size_t>(height) + 2) * stride) {}
    const std::uint8_t* row(int y) const { return &marks[static_cast<std::size_t>(y + 1) * stride]; }
    std::uint8_t* row(int y) { return &marks[static_cast<std::size_t>(y + 1) * stride]; }

    std::size_t stride;
    std::vector<std::uint8_t> marks;
};

// Blocks free space that no two by two free pixels fit into.
void shut_slits(Cells& cells, const RunMarks& held);

}  // namespace ffseg::field
