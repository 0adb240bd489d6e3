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

// The pixels of one chain after the other, on one stack.
class Linker {
public:
    Linker(int height, int width, std::uint8_t* marks) : height_(height), width_(width), marks_(marks) {}

    // Mark all that is connected to a strong pixel as edge, or as nothing if the chain is short.
    void follow(std::uint8_t* seed) {
        const std::ptrdiff_t place = seed - marks_;
        chain_.clear();
        take({seed, static_cast<int>(place % width_), static_cast<int>(place / width_)});
        for (std::size_t at = 0; at < chain_.size(); ++at) {
            const Pixel here = chain_[at];
            if (here.y > 0) take_open(here, -1);
            take_open(here, 0);
            if (here.y + 1 < height_) take_open(here, 1);
        }
        if (chain_.size() >= kShortestEdge) return;
        for (const Pixel& pixel : chain_) *pixel.mark = kNone;
    }

private:
    struct Pixel {
        std::uint8_t* mark;
        int x, y;
    };

    void take(const Pixel& pixel) {
        *pixel.mark = kTaken;
        chain_.push_back(pixel);
    }

    // Those beside a pixel in one row: most are none or taken, and all three are asked at once.
    void take_open(const Pixel& here, int down) {
        std::uint8_t* const row = here.mark + static_cast<std::ptrdiff_t>(down) * width_;
        const int left = here.x > 0 ? -1 : 0, right = here.x + 1 < width_ ? 1 : 0;
        if (((row[left] | row[0] | row[right]) & kOpen) == 0) return;
        for (int by = left; by <= right; ++by) {
            if ((row[by] & kOpen) != 0) take({row + by, here.x + by, here.y + down});
        }
    }

    int height_, width_;
    std::uint8_t* marks_;
    std::vector<Pixel> chain_;
};

// Thresholds of one row of blocks, pixel by pixel.
void spread(const std::uint16_t* blocks, std::vector<std::uint16_t>& out) {
    for (auto at = out.begin(); at != out.end();) {
        at = std::fill_n(at, std::min<std::ptrdiff_t>(NoiseMap::kBlock, out.end() - at), *blocks++);
    }
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
    std::uint8_t* const end = edges + count;
    for (std::uint8_t* at = edges; at < end;) {
        at = static_cast<std::uint8_t*>(std::memchr(at, kStrong, static_cast<std::size_t>(end - at)));
        if (at == nullptr) break;
        linker.follow(at);
    }
    keep_edges(edges, count);
}

}  // namespace ffseg::edges
