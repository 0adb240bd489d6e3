#include "edges/canny.hpp"

#include <algorithm>
#include <cstddef>
#include <cstring>

#include "common/lanes.hpp"
#include "edges/noise.hpp"

namespace ffseg::edges {
namespace {

// The outline of the smallest blob that smoothing leaves has eight pixels; shorter chains are noise.
constexpr std::size_t kShortestEdge = 6;

// What a pixel is while edges are linked; ridges below the low threshold are none.
enum Mark : std::uint8_t { kNone = 0, kWeak = 1, kStrong = 2, kTaken = 4 };
constexpr std::uint8_t kOpen = kWeak | kStrong;
constexpr std::uint8_t kEdge = 255;

struct Pixel {
    int x, y;
};

// The pixels of one chain after the other, on one stack.
class Linker {
public:
    Linker(int height, int width, std::uint8_t* marks) : height_(height), width_(width), marks_(marks) {}

    // Mark all that is connected to a strong pixel as edge, or as nothing if the chain is short.
    void follow(Pixel seed) {
        chain_.clear();
        take(seed);
        for (std::size_t at = 0; at < chain_.size(); ++at) {
            const Pixel here = chain_[at];
            const bool inside = here.x > 0 && here.x + 1 < width_;
            for (int y = std::max(here.y - 1, 0); y <= std::min(here.y + 1, height_ - 1); ++y) {
                const std::uint8_t* middle = &mark({here.x, y});
                // Most pixels near an edge are none or taken: three are asked at once.
                if (inside && ((middle[-1] | middle[0] | middle[1]) & kOpen) == 0) continue;
                for (int x = std::max(here.x - 1, 0); x <= std::min(here.x + 1, width_ - 1); ++x) take_open({x, y});
            }
        }
        if (chain_.size() >= kShortestEdge) return;
        for (const Pixel pixel : chain_) mark(pixel) = kNone;
    }

private:
    std::uint8_t& mark(Pixel at) { return marks_[static_cast<std::ptrdiff_t>(at.y) * width_ + at.x]; }
    void take(Pixel at) {
        mark(at) = kTaken;
        chain_.push_back(at);
    }

    void take_open(Pixel at) {
        if ((mark(at) & kOpen) != 0) take(at);
    }

    int height_, width_;
    std::uint8_t* marks_;
    std::vector<Pixel> chain_;
};

// Thresholds of one row of blocks, pixel by pixel.
void spread(const std::uint16_t* blocks, std::vector<std::uint16_t>& out) {
    for (std::size_t x = 0; x < out.size(); ++x) out[x] = blocks[x / NoiseMap::kBlock];
}

FFSEG_CLONES
void mark_row(const std::uint16_t* gradient, const std::uint16_t* low, const std::uint16_t* high, std::uint8_t* marks,
              int count) {
    FFSEG_APART
    for (int x = 0; x < count; ++x) {
        const std::uint16_t weak = gradient[x] >= low[x], strong = gradient[x] >= high[x];
        const std::uint16_t passed = static_cast<std::uint16_t>(weak + strong);
        marks[x] = static_cast<std::uint8_t>(marks[x] != 0 ? passed : 0);
    }
}

// What no strong pixel has reached is no edge.
FFSEG_CLONES
void keep_edges(std::uint8_t* marks, std::ptrdiff_t count) {
    for (std::ptrdiff_t i = 0; i < count; ++i) marks[i] = marks[i] == kTaken ? kEdge : std::uint8_t{kNone};
}

}  // namespace

void link_edges(const std::uint16_t* gradient, int height, int width, const ThresholdMap& thresholds,
                std::uint8_t* edges) {
    std::vector<std::uint16_t> low(static_cast<std::size_t>(width)), high(low.size());
    for (int y = 0; y < height; ++y) {
        if (y % NoiseMap::kBlock == 0) {
            const std::ptrdiff_t blocks = static_cast<std::ptrdiff_t>(y / NoiseMap::kBlock) * thresholds.columns;
            spread(thresholds.low.data() + blocks, low);
            spread(thresholds.high.data() + blocks, high);
        }
        const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(y) * width;
        mark_row(gradient + row, low.data(), high.data(), edges + row, width);
    }
    Linker linker(height, width, edges);
    const std::ptrdiff_t count = static_cast<std::ptrdiff_t>(height) * width;
    const std::uint8_t* const end = edges + count;
    for (const std::uint8_t* at = edges; at < end;) {
        at = static_cast<const std::uint8_t*>(std::memchr(at, kStrong, static_cast<std::size_t>(end - at)));
        if (at == nullptr) break;
        linker.follow({static_cast<int>((at - edges) % width), static_cast<int>((at - edges) / width)});
    }
    keep_edges(edges, count);
}

}  // namespace ffseg::edges
