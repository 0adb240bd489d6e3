#include "edges/noise.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>

namespace ffseg {
namespace {

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

}  // namespace

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

}  // namespace ffseg
