#include "edges/edges.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <iterator>

// The loops below are plain C++; where the compiler can, it also builds an AVX2 version and picks one at load time.
// Results are the same: only exact integer arithmetic and correctly rounded square roots are used.
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__)
#define FFSEG_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define FFSEG_CLONES
#endif

namespace ffseg {
namespace {

// The outline of the smallest blob that smoothing leaves has eight pixels; shorter chains are noise.
constexpr std::size_t kShortestEdge = 6;

// A Sobel sum is 8 times the gradient, so 4 * |Sobel| is 32 * |gradient|.
constexpr float kSobelToStored = kGradientScale / 8.0f;

// One grey row between its two neighbours: vertical sums are formed first so that the inner loop is straight.
FFSEG_CLONES
void grey_row(const std::uint8_t* up, const std::uint8_t* mid, const std::uint8_t* down, std::int16_t* smooth,
              std::int16_t* slope, std::uint16_t* out, int width) {
    for (int x = 0; x < width; ++x) {
        smooth[x + 1] = static_cast<std::int16_t>(up[x] + 2 * mid[x] + down[x]);
        slope[x + 1] = static_cast<std::int16_t>(down[x] - up[x]);
    }
    smooth[0] = smooth[1];
    slope[0] = slope[1];
    smooth[width + 1] = smooth[width];
    slope[width + 1] = slope[width];
    for (int x = 0; x < width; ++x) {
        const int gx = smooth[x + 2] - smooth[x];
        const int gy = slope[x] + 2 * slope[x + 1] + slope[x + 2];
        const float squared = static_cast<float>(gx * gx + gy * gy);
        out[x] = static_cast<std::uint16_t>(std::sqrt(squared) * kSobelToStored + 0.5f);
    }
}

FFSEG_CLONES
void colour_row(const std::uint8_t* up, const std::uint8_t* mid, const std::uint8_t* down, int channels,
                std::uint16_t* out, int width) {
    for (int x = 0; x < width; ++x) {
        const int left = std::max(x - 1, 0) * channels, here = x * channels;
        const int right = std::min(x + 1, width - 1) * channels;
        int strongest = 0;
        for (int c = 0; c < channels; ++c) {
            const int gx = (up[right + c] + 2 * mid[right + c] + down[right + c]) -
                           (up[left + c] + 2 * mid[left + c] + down[left + c]);
            const int gy = (down[left + c] + 2 * down[here + c] + down[right + c]) -
                           (up[left + c] + 2 * up[here + c] + up[right + c]);
            strongest = std::max(strongest, gx * gx + gy * gy);
        }
        out[x] = static_cast<std::uint16_t>(std::sqrt(static_cast<float>(strongest)) * kSobelToStored + 0.5f);
    }
}

struct Slope {
    int gx, gy;
};

// The Sobel vector of the strongest channel at one pixel.
Slope slope_at(const GreyView& image, int x, int y) {
    const int step = image.channels, row = image.width * step;
    const std::uint8_t* up = image.data + static_cast<std::ptrdiff_t>(std::max(y - 1, 0)) * row;
    const std::uint8_t* mid = image.data + static_cast<std::ptrdiff_t>(y) * row;
    const std::uint8_t* down = image.data + static_cast<std::ptrdiff_t>(std::min(y + 1, image.height - 1)) * row;
    const int left = std::max(x - 1, 0) * step, here = x * step, right = std::min(x + 1, image.width - 1) * step;
    Slope best{0, 0};
    int strongest = -1;
    for (int c = 0; c < step; ++c) {
        const int gx = (up[right + c] + 2 * mid[right + c] + down[right + c]) -
                       (up[left + c] + 2 * mid[left + c] + down[left + c]);
        const int gy = (down[left + c] + 2 * down[here + c] + down[right + c]) -
                       (up[left + c] + 2 * up[here + c] + up[right + c]);
        if (gx * gx + gy * gy > strongest) {
            strongest = gx * gx + gy * gy;
            best = {gx, gy};
        }
    }
    return best;
}

// Is the gradient at (x, y) a maximum along its direction, quantised to the 8 neighbours as in Canny's method?
// A tie keeps the pixel on the lower-index side, so that a ramp two pixels wide gives one edge.
bool is_ridge(const std::uint16_t* gradient, int height, int width, int x, int y, Slope slope) {
    const int ax = std::abs(slope.gx), ay = std::abs(slope.gy);
    int dx = 0, dy = 0;
    // tan(22.5 deg) = 0.4142 = 13573 / 32768
    if (static_cast<std::int64_t>(ay) * 32768 < static_cast<std::int64_t>(ax) * 13573) {
        dx = 1;
    } else if (static_cast<std::int64_t>(ax) * 32768 < static_cast<std::int64_t>(ay) * 13573) {
        dy = 1;
    } else {
        dx = (slope.gx > 0) == (slope.gy > 0) ? 1 : -1;
        dy = 1;
    }
    const auto value = [&](int u, int v) -> int {
        if (u < 0 || v < 0 || u >= width || v >= height) return 0;
        return gradient[static_cast<std::ptrdiff_t>(v) * width + u];
    };
    const int here = value(x, y);
    return here > value(x - dx, y - dy) && here >= value(x + dx, y + dy);
}

// The highest value in each whole block of a row.
FFSEG_CLONES
void highest_of_blocks(const std::uint16_t* row, int blocks, std::uint16_t* highest) {
    constexpr int kBlock = NoiseMap::kBlock;
    for (int block = 0; block < blocks; ++block) {
        std::uint16_t most = 0;
        for (int i = 0; i < kBlock; ++i) most = std::max(most, row[block * kBlock + i]);
        highest[block] = most;
    }
}

// Counts of stored gradients; 180.4 * 32 = 5773 is the largest. The bins below kFine are exact, those above 32 wide.
class Histogram {
public:
    void add(std::uint16_t value) {
        ++counts_[bin(value)];
        ++total_;
    }
    void merge(const Histogram& other) {
        for (std::size_t i = 0; i < counts_.size(); ++i) counts_[i] += other.counts_[i];
        total_ += other.total_;
    }
    std::int64_t total() const { return total_; }
    int median() const {
        std::int64_t seen = 0;
        for (std::size_t i = 0; i < counts_.size(); ++i) {
            seen += counts_[i];
            if (2 * seen > total_) return static_cast<int>(i < kFine ? i : kFine + (i - kFine) * 32 + 16);
        }
        return 0;
    }

private:
    static constexpr std::size_t kFine = 512;
    static std::size_t bin(std::uint16_t value) {
        return value < kFine ? value : std::min<std::size_t>(kFine + (value - kFine) / 32, kFine + 255);
    }
    std::array<std::int32_t, kFine + 256> counts_{};
    std::int64_t total_ = 0;
};

struct Map {
    const GreyView& image;
    const std::uint16_t* gradient;
    const ThresholdMap& thresholds;

    bool ridge(int x, int y) const {
        return is_ridge(gradient, image.height, image.width, x, y, slope_at(image, x, y));
    }
    std::uint16_t low(int x, int y) const {
        constexpr int kBlock = NoiseMap::kBlock;
        const std::size_t block = static_cast<std::size_t>(y / kBlock * thresholds.columns + x / kBlock);
        return std::max<std::uint16_t>(thresholds.low[block], 1);
    }
};

// Hysteresis: a strong ridge pixel takes every ridge pixel above the low threshold that is connected to it. Whether a
// pixel is a ridge is asked only here: most weak ones are noise far from any strong one. Short chains are left out.
void follow(const std::vector<std::ptrdiff_t>& strong, const Map& map, std::uint8_t* out) {
    constexpr std::uint8_t kSeen = 1, kEdge = 255;
    const int height = map.image.height, width = map.image.width;
    std::vector<std::ptrdiff_t> chain, kept, rejected;
    for (const std::ptrdiff_t seed : strong) {
        if (out[seed] != 0) continue;
        chain.assign(1, seed);
        out[seed] = kSeen;
        for (std::size_t at = 0; at < chain.size(); ++at) {
            const int x = static_cast<int>(chain[at] % width), y = static_cast<int>(chain[at] / width);
            for (int v = std::max(y - 1, 0); v <= std::min(y + 1, height - 1); ++v) {
                for (int u = std::max(x - 1, 0); u <= std::min(x + 1, width - 1); ++u) {
                    const std::ptrdiff_t near = static_cast<std::ptrdiff_t>(v) * width + u;
                    if (out[near] != 0 || map.gradient[near] < map.low(u, v)) continue;
                    out[near] = kSeen;
                    (map.ridge(u, v) ? chain : rejected).push_back(near);
                }
            }
        }
        (chain.size() >= kShortestEdge ? kept : rejected).insert(
            (chain.size() >= kShortestEdge ? kept : rejected).end(), chain.begin(), chain.end());
    }
    for (const std::ptrdiff_t at : kept) out[at] = kEdge;
    for (const std::ptrdiff_t at : rejected) out[at] = 0;
}

}  // namespace

void gradient_magnitude(const GreyView& image, std::uint16_t* out) {
    const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(image.width) * image.channels;
    std::vector<std::int16_t> smooth(static_cast<std::size_t>(image.width) + 2), slope(smooth.size());
    for (int y = 0; y < image.height; ++y) {
        const std::uint8_t* mid = image.data + y * row;
        const std::uint8_t* up = y > 0 ? mid - row : mid;
        const std::uint8_t* down = y + 1 < image.height ? mid + row : mid;
        std::uint16_t* line = out + static_cast<std::ptrdiff_t>(y) * image.width;
        if (image.channels == 1) {
            grey_row(up, mid, down, smooth.data(), slope.data(), line, image.width);
        } else {
            colour_row(up, mid, down, image.channels, line, image.width);
        }
    }
}

NoiseMap noise_map(const std::uint16_t* gradient, const std::uint8_t* domain, int height, int width) {
    constexpr int kBlock = NoiseMap::kBlock, kWindow = NoiseMap::kNoiseWindow;
    constexpr int kRowSkip = 4, kSkip = 2;  // 512 of the 4096 pixels of a window: the median to 5 per cent
    NoiseMap map;
    map.rows = (height + kBlock - 1) / kBlock;
    map.columns = (width + kBlock - 1) / kBlock;
    const int rows = (height + kWindow - 1) / kWindow, columns = (width + kWindow - 1) / kWindow;
    Histogram all;
    std::vector<int> medians(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns), -1);
    for (int r = 0; r < rows; ++r) {
        for (int c = 0; c < columns; ++c) {
            Histogram window;
            const int bottom = std::min(height, (r + 1) * kWindow), right = std::min(width, (c + 1) * kWindow);
            for (int y = r * kWindow; y < bottom; y += kRowSkip) {
                const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(y) * width;
                for (int x = c * kWindow + (y / kRowSkip) % kSkip; x < right; x += kSkip) {
                    if (domain == nullptr || domain[row + x] != 0) window.add(gradient[row + x]);
                }
            }
            if (window.total() * 8 * kRowSkip * kSkip >= kWindow * kWindow) {
                medians[static_cast<std::size_t>(r * columns + c)] = window.median();
            }
            all.merge(window);
        }
    }
    std::vector<int> sorted;
    std::copy_if(medians.begin(), medians.end(), std::back_inserter(sorted), [](int median) { return median >= 0; });
    std::sort(sorted.begin(), sorted.end());
    map.quiet = static_cast<std::uint16_t>(sorted.empty() ? all.median() : sorted[sorted.size() / 4]);
    for (int& median : medians) median = median < 0 ? map.quiet : median;
    map.blocks.resize(static_cast<std::size_t>(map.rows) * static_cast<std::size_t>(map.columns));
    for (int r = 0; r < map.rows; ++r) {  // linear between the middles of the windows
        const double y = std::clamp((r + 0.5) * kBlock / kWindow - 0.5, 0.0, rows - 1.0);
        for (int c = 0; c < map.columns; ++c) {
            const double x = std::clamp((c + 0.5) * kBlock / kWindow - 0.5, 0.0, columns - 1.0);
            const int top = static_cast<int>(y), left = static_cast<int>(x);
            const int below = std::min(top + 1, rows - 1), right = std::min(left + 1, columns - 1);
            const double v = y - top, u = x - left;
            const auto at = [&](int i, int j) { return medians[static_cast<std::size_t>(i * columns + j)]; };
            const double value = (1 - v) * ((1 - u) * at(top, left) + u * at(top, right)) +
                                 v * ((1 - u) * at(below, left) + u * at(below, right));
            map.blocks[static_cast<std::size_t>(r * map.columns + c)] = static_cast<std::uint16_t>(value + 0.5);
        }
    }
    return map;
}

void canny(const GreyView& image, const std::uint16_t* gradient, const ThresholdMap& thresholds, std::uint8_t* out) {
    constexpr int kBlock = NoiseMap::kBlock;
    const int height = image.height, width = image.width;
    const Map map{image, gradient, thresholds};
    std::memset(out, 0, static_cast<std::size_t>(height) * static_cast<std::size_t>(width));
    std::vector<std::ptrdiff_t> strong;
    std::vector<std::uint16_t> highest(static_cast<std::size_t>(thresholds.columns), 65535);  // a cut block is looked at
    for (int y = 0; y < height; ++y) {
        const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(y) * width;
        const std::uint16_t* highs = thresholds.high.data() + static_cast<std::ptrdiff_t>(y / kBlock) * thresholds.columns;
        highest_of_blocks(gradient + row, width / kBlock, highest.data());
        for (int block = 0; block < thresholds.columns; ++block) {
            const std::uint16_t high = std::max<std::uint16_t>(highs[block], 1);
            if (highest[static_cast<std::size_t>(block)] < high) continue;
            const int end = std::min((block + 1) * kBlock, width);
            for (int x = block * kBlock; x < end; ++x) {
                if (gradient[row + x] >= high && map.ridge(x, y)) strong.push_back(row + x);
            }
        }
    }
    follow(strong, map, out);
}

}  // namespace ffseg
