// contour.clearance and a robot's footprint: the ground that a disc of this diameter can reach.
#include <algorithm>
#include <cstring>

#include "freeform/field/bitmap.hpp"
#include "freeform/field/field.hpp"

namespace ffseg::field {
namespace {

// Pixels subtracted from the disc's radius. Edges lie up to half a pixel beside the sides of a drawn passage, and the
// disc is centred on pixels: so passages one pixel wider than the clearance are open at every angle, those one pixel
// narrower closed.
constexpr double kSlack = 0.65;
// Pixels: free pixels farther than the disc's radius plus this from all places the disc can reach do not belong to its
// ground.
constexpr double kBeyond = 1.0;
// Pixels: a distant pixel shows several cells of the ground plane, so free pixels this near to what the disc covers
// belong to its ground, too.
constexpr double kBeside = 1.5;
// Ground that not even a disc of this fraction of the footprint's radius can cover is closed, wherever it lies: faces
// of a box with the grey level of the floor are narrower, the ground between two marks is wider.
constexpr double kMinRadiusFraction = 0.5;

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

// Calls each(x, y) with the pixels of a bitmap.
template <class Each>
void for_pixels(const Bitmap& pixels, const Each& each) {
    for (int y = 0; y < pixels.height(); ++y) {
        for (std::size_t word = 0; word < pixels.words(); ++word) {
            Bitmap::Word left = pixels.row(y)[word];
            for (int x = static_cast<int>(word) * Bitmap::kBits; left != 0; ++x, left >>= 1) {
                if ((left & 1) != 0) each(x, y);
            }
        }
    }
}

// Cell number of pixels whose ground lies beyond the plane. The width of passages is unknown there, and none is
// closed.
constexpr std::int32_t kBeyondPlane = -2;

// The pixels whose ground lies within `radius` cells of these pixels' ground; beyond the plane, the pixels themselves.
Bitmap grown_on(const freeform::Plane& plane, const Bitmap& pixels, int width, double radius) {
    Bitmap ground(plane.side, plane.side), out(pixels.height(), width);
    const auto cell = [&](int x, int y) {
        return plane.cells[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
    };
    for_pixels(pixels, [&](int x, int y) {
        if (x < width && cell(x, y) >= 0) ground.add(cell(x, y) & 0xffff, cell(x, y) >> 16);
    });
    ground = ground.grown(radius);
    for (int y = 0; y < out.height(); ++y) {
        for (int x = 0; x < width; ++x) {
            const std::int32_t at = cell(x, y);
            if (at >= 0 ? ground.holds(at & 0xffff, at >> 16) : at == kBeyondPlane && pixels.holds(x, y)) out.add(x, y);
        }
    }
    return out;
}

// Removes the pixels that show no ground.
void keep_ground(const freeform::Plane& plane, int width, Bitmap& pixels) {
    Bitmap shown(pixels.height(), width);
    std::size_t at = 0;
    for (int y = 0; y < shown.height(); ++y) {
        for (int x = 0; x < width; ++x, ++at) {
            if (plane.cells[at] >= 0 || plane.cells[at] == kBeyondPlane) shown.add(x, y);
        }
    }
    pixels.keep(shown);
}

// The ground that no disc clear of the edges covers.
Bitmap uncovered(const freeform::Plane& plane, const Bitmap& edges, int width, double radius, const Bitmap& ground) {
    Bitmap roomy(ground.height(), width), left = ground;
    for (int y = 0; y < roomy.height(); ++y) std::fill_n(roomy.row(y), roomy.words(), ~Bitmap::Word{0});
    roomy.remove(grown_on(plane, edges, width, radius));
    keep_ground(plane, width, roomy);
    left.remove(grown_on(plane, roomy, width, radius).grown(kBeside));
    return left;
}

}  // namespace

bool Field::close_passages(const std::uint8_t* edges, const std::vector<Vec2>& starts, double clearance,
                           const freeform::Plane& plane) {
    const bool mapped = plane.cells != nullptr;
    const double radius = 0.5 * clearance - kSlack;
    Bitmap thin(height(), width()), free(height(), width());
    for (int y = 0; y < height(); ++y) {
        add_bytes(edges + static_cast<std::size_t>(y) * static_cast<std::size_t>(width()), width(), false, thin.row(y));
        add_bytes(&cells_.blocked[cells_.at(0, y)], width(), true, free.row(y));
    }
    Bitmap roomy = free;  // where the disc fits
    if (radius > 0) roomy.remove(mapped ? grown_on(plane, thin, width(), radius) : thin.grown(radius));
    if (mapped) keep_ground(plane, width(), roomy);
    Bitmap reached(height(), width());
    for (const Vec2 p : starts) {
        const auto x = static_cast<int>(p.x + 0.5), y = static_cast<int>(p.y + 0.5);
        if (roomy.holds(x, y)) reached.add(x, y);
    }
    if (reached.empty()) return false;
    reached = reached.flooded(roomy);
    const double covered = std::max(radius, 0.0) + kBeyond;
    free.remove(mapped ? grown_on(plane, reached, width(), covered).grown(kBeside) : reached.grown(covered));
    roomy.remove(reached);
    roomy.keep(free);
    Bitmap shut = roomy.flooded(free);
    if (mapped) shut.add(uncovered(plane, thin, width(), std::max(kMinRadiusFraction * radius, 0.0), free));
    if (shut.empty()) return true;
    for_pixels(shut, [&](int x, int y) { cells_.blocked[cells_.at(x, y)] = kEdge; });
    std::vector<std::uint8_t> occupied(cells_.tiles_x * cells_.tiles_y);
    for (int y = 0; y < height(); ++y) {
        std::uint8_t* const tiles = &occupied[static_cast<std::size_t>(y >> kTileShift) * cells_.tiles_x];
        for (int x = 0; x < width(); ++x) tiles[x >> kTileShift] |= cells_.blocked[cells_.at(x, y)];
    }
    measure_reach(cells_, occupied);
    return true;
}

}  // namespace ffseg::field
