#include "edges/noise.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>

#include "common/lanes.hpp"

namespace ffseg::edges {
namespace {

// Samples of a window: a half of the pixels of every fourth row, 512 of 4096: the median to 5 per cent.
constexpr int kRowSkip = 4, kSkip = 2;

// Every other value.
FFSEG_CLONES
void thin_out(const std::uint16_t* values, int count, std::uint16_t* out) {
    const std::uint16_t* __restrict from = values;
    std::uint16_t* __restrict to = out;
    for (int i = 0; i < count; ++i) to[i] = from[kSkip * i];
}

// The samples of some rows, those of one row together.
class Samples {
public:
    Samples(const std::uint16_t* gradient, const std::uint8_t* domain, int width)
        : gradient_(gradient), domain_(domain), width_(width), row_(static_cast<std::size_t>(width) / kSkip + 1) {}

    // Append those of the rows from `top`, sorted into windows as wide as `across` pixels.
    void add(int top, int bottom, int across, std::vector<std::vector<std::uint16_t>>& windows) {
        for (int y = top; y < bottom; y += kRowSkip) {
            const int first = (y / kRowSkip) % kSkip;
            const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(y) * width_ + first;
            thin_out(gradient_ + at, until(width_, first), row_.data());
            for (std::size_t c = 0; c < windows.size(); ++c) {
                const int from = until(static_cast<int>(c) * across, first);
                const int to = until(std::min(width_, static_cast<int>(c + 1) * across), first);
                append(at, from, to, windows[c]);
            }
        }
    }

private:
    // Samples before column x.
    static int until(int x, int first) { return std::max(0, (x - first + kSkip - 1) / kSkip); }
    void append(std::ptrdiff_t at, int from, int to, std::vector<std::uint16_t>& out) {
        if (domain_ == nullptr) {
            out.insert(out.end(), row_.data() + from, row_.data() + to);
            return;
        }
        for (int i = from; i < to; ++i) {
            if (domain_[at + kSkip * i] != 0) out.push_back(row_[static_cast<std::size_t>(i)]);
        }
    }

    const std::uint16_t* gradient_;
    const std::uint8_t* domain_;
    int width_;
    std::vector<std::uint16_t> row_;
};

// How many values are at most `limit`; counted in 16-bit lanes, so in pieces.
FFSEG_CLONES
std::size_t count_up_to(const std::uint16_t* values, std::size_t size, std::uint16_t limit) {
    constexpr std::size_t kPiece = 32768;
    std::size_t total = 0;
    for (std::size_t from = 0; from < size; from += kPiece) {
        const std::size_t end = std::min(size, from + kPiece);
        std::uint16_t found = 0;
        for (std::size_t i = from; i < end; ++i) found = static_cast<std::uint16_t>(found + (values[i] <= limit));
        total += found;
    }
    return total;
}

// The least value that more than half of the values do not exceed, found bit by bit; 0 of none.
int median(const std::vector<std::uint16_t>& values) {
    // Most medians lie below the one, all gradients below the other, see gradient.hpp.
    constexpr int kFirst = 64, kMax = 1 << 13;
    const auto exceeded = [&](int limit) {  // by half of the values or more
        return 2 * count_up_to(values.data(), values.size(), static_cast<std::uint16_t>(limit)) <= values.size();
    };
    int step = kFirst;
    while (step < kMax && exceeded(step - 1)) step *= 2;
    int below = -1;
    for (step /= 2; step > 0; step /= 2) {
        if (exceeded(below + step)) below += step;
    }
    return values.empty() ? 0 : below + 1;
}

int median_of_all(Samples& samples, int height, int width) {
    std::vector<std::vector<std::uint16_t>> one(1);
    samples.add(0, height, width, one);
    return median(one[0]);
}

}  // namespace

NoiseMap noise_map(const std::uint16_t* gradient, const std::uint8_t* domain, int height, int width) {
    constexpr int kBlock = NoiseMap::kBlock, kWindow = NoiseMap::kNoiseWindow;
    NoiseMap map;
    map.rows = (height + kBlock - 1) / kBlock;
    map.columns = (width + kBlock - 1) / kBlock;
    const int rows = (height + kWindow - 1) / kWindow, columns = (width + kWindow - 1) / kWindow;
    std::vector<int> medians(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns), -1);
    Samples samples(gradient, domain, width);
    std::vector<std::vector<std::uint16_t>> windows(static_cast<std::size_t>(columns));
    for (int r = 0; r < rows; ++r) {
        for (auto& window : windows) window.clear();
        samples.add(r * kWindow, std::min(height, (r + 1) * kWindow), kWindow, windows);
        for (int c = 0; c < columns; ++c) {
            const auto& window = windows[static_cast<std::size_t>(c)];
            if (window.size() * 8 * kRowSkip * kSkip < kWindow * kWindow) continue;
            medians[static_cast<std::size_t>(r * columns + c)] = median(window);
        }
    }
    std::vector<int> sorted;
    std::copy_if(medians.begin(), medians.end(), std::back_inserter(sorted), [](int median) { return median >= 0; });
    std::sort(sorted.begin(), sorted.end());
    map.quiet =
        static_cast<std::uint16_t>(sorted.empty() ? median_of_all(samples, height, width) : sorted[sorted.size() / 4]);
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

}  // namespace ffseg::edges
