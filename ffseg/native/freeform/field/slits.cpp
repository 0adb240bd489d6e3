// Slits: free space too narrow for two by two pixels, which counts as blocked.
#include <algorithm>
#include <array>

#include "freeform/field/field.hpp"
#include "freeform/field/runs.hpp"

namespace ffseg::field {
namespace {

// Those free ones of kRun pixels in a row that no square of two by two free pixels covers become 1 in `slits`; says
// whether there are any. All that is blocked has the lowest bit.
FFSEG_CLONES
bool find_slits(const std::uint8_t* row, std::ptrdiff_t stride, std::uint8_t* __restrict slits) {
    const std::uint8_t *const up = row - stride, *const down = row + stride;
    Eight any = 0;
    for (int x = 0; x < kRun; x += kEight) {
        const Eight here = eight(row + x), left = eight(row + x - 1), right = eight(row + x + 1);
        const Eight above = eight(up + x) | ((eight(up + x - 1) | left) & (eight(up + x + 1) | right));
        const Eight below = eight(down + x) | ((eight(down + x - 1) | left) & (eight(down + x + 1) | right));
        const Eight shut = above & below & ~here & kOnes;
        std::memcpy(slits + x, &shut, sizeof shut);
        any |= shut;
    }
    return any != 0;
}

// cells[c] |= bits[c]
void add_bits(const std::uint8_t* bits, std::uint8_t* cells, std::size_t count) {
    std::size_t at = 0;
    for (; at + kEight <= count; at += kEight) {
        const Eight sum = eight(bits + at) | eight(cells + at);
        std::memcpy(cells + at, &sum, sizeof sum);
    }
    for (; at < count; ++at) cells[at] |= bits[at];
}

}  // namespace

// Free space is opened by a square of two by two pixels. Only runs of a row that hold something blocked, or lie
// between two that do, are looked at; they are marked when the next row has been looked at. A slit lies between edges
// on either side, so no farther than the band reaches beyond both: what is known of free tiles stays true.
void shut_slits(Cells& cells, const RunMarks& held) {
    const auto width = static_cast<std::size_t>(cells.width);
    std::vector<std::uint8_t> slits(2 * held.stride * kRun);
    std::array<std::vector<std::size_t>, 2> found;  // runs with slits in this row and in the one before
    const auto mark = [&](int y) {
        std::vector<std::size_t>& runs = found[static_cast<std::size_t>(y & 1)];
        const std::uint8_t* const row = &slits[static_cast<std::size_t>(y & 1) * held.stride * kRun];
        for (const std::size_t run : runs) {
            add_bits(row + run * kRun, &cells.blocked[cells.at(0, y) + run * kRun],
                     std::min<std::size_t>(kRun, width - run * kRun));
        }
        runs.clear();
    };
    for (int y = 0; y < cells.height; ++y) {
        std::uint8_t* const row = &slits[static_cast<std::size_t>(y & 1) * held.stride * kRun];
        for (std::size_t first = 0; first < held.stride; first += kEight) {
            const Eight near =
                eight(held.row(y) + first) | (eight(held.row(y - 1) + first) & eight(held.row(y + 1) + first));
            std::array<std::uint8_t, kEight> each;
            std::memcpy(each.data(), &near, sizeof near);
            for (std::size_t one = 0; near != 0 && one < kEight; ++one) {
                if (each[one] == 0) continue;
                const std::size_t run = first + one;
                const std::uint8_t* const part = &cells.blocked[cells.at(0, y) + run * kRun];
                if (!find_slits(part, static_cast<std::ptrdiff_t>(cells.stride), row + run * kRun)) continue;
                found[static_cast<std::size_t>(y & 1)].push_back(run);
            }
        }
        if (y > 0) mark(y - 1);
    }
    mark(cells.height - 1);
}

}  // namespace ffseg::field
