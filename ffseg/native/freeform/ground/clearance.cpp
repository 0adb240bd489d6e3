// contour.clearance: which ground a disc of this diameter can get to.
#include <algorithm>
#include <cstring>

#include "freeform/ground/bitmap.hpp"
#include "freeform/ground/field.hpp"

namespace ffseg::ground {
namespace {

// The edges of a drawn passage lie up to half a pixel beside its sides, and the disc stands on pixel centres: with so
// many pixels off its radius passages a pixel wider than the clearance are open at every angle, those a pixel narrower
// shut.
constexpr double kSlack = 0.65;
// Free pixels so much farther from where the disc can be than its radius are no part of its ground.
constexpr double kBeyond = 1.0;

// The zero bytes of a row, or the others, as bits.
void add_bytes(const std::uint8_t* bytes, int count, bool zero, Bitmap::Word* bits) {
    constexpr std::uint64_t kOnes = 0x0101010101010101, kGather = 0x0102040810204080;  // byte k of 0 or 1 to bit 56 + k
    for (int x = 0; x < count; x += 8) {
        std::uint64_t eight = 0;
        if (x + 8 <= count) {
            std::memcpy(&eight, bytes + x, sizeof eight);
        } else {
            std::memcpy(&eight, bytes + x, static_cast<std::size_t>(count - x));
        }
        if (!zero && eight == 0) continue;
        std::uint64_t set = (eight | ((eight & 0x7f * kOnes) + 0x7f * kOnes)) >> 7 & kOnes;
        if (zero) set ^= kOnes;
        std::uint64_t found = set * kGather >> 56;
        if (x + 8 > count) found &= (std::uint64_t{1} << (count - x)) - 1;
        bits[x / Bitmap::kBits] |= found << (x % Bitmap::kBits);
    }
}

}  // namespace

bool Field::close_passages(const std::uint8_t* edges, const std::vector<Vec2>& starts, double clearance) {
    const double radius = 0.5 * clearance - kSlack;
    Bitmap thin(height(), width()), free(height(), width());
    for (int y = 0; y < height(); ++y) {
        add_bytes(edges + static_cast<std::size_t>(y) * static_cast<std::size_t>(width()), width(), false, thin.row(y));
        add_bytes(&cells_.blocked[cells_.at(0, y)], width(), true, free.row(y));
    }
    Bitmap roomy = free;  // where the disc fits
    if (radius > 0) roomy.remove(thin.grown(radius));
    Bitmap reached(height(), width());
    for (const Vec2 p : starts) {
        const auto x = static_cast<int>(p.x + 0.5), y = static_cast<int>(p.y + 0.5);
        if (roomy.holds(x, y)) reached.add(x, y);
    }
    if (reached.empty()) return false;
    reached = reached.flooded(roomy);
    free.remove(reached.grown(std::max(radius, 0.0) + kBeyond));
    roomy.remove(reached);
    roomy.keep(free);
    if (roomy.empty()) return true;
    const Bitmap shut = roomy.flooded(free);
    for (int y = 0; y < height(); ++y) {
        for (std::size_t word = 0; word < shut.words(); ++word) {
            for (int bit = 0; shut.row(y)[word] >> bit != 0; ++bit) {
                if ((shut.row(y)[word] >> bit & 1) != 0)
                    cells_.blocked[cells_.at(static_cast<int>(word) * Bitmap::kBits + bit, y)] = kEdge;
                if (bit == Bitmap::kBits - 1) break;
            }
        }
    }
    build_tiles(cells_);
    return true;
}

}  // namespace ffseg::ground
