// Sums of colours over sets of pixels, from sums along the rows kept at every 32nd column.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/picture.hpp"
#include "region/spans.hpp"

namespace ffseg::region {

constexpr int kMostBins = 512;  // of all channels together

// Exact sums over a set: first the number of pixels, then each channel's sum, then the products of channels
// (0 0, 0 1, .., 1 1, ..), then the counts of the joint histogram.
using Totals = std::vector<std::int64_t>;

// An image and its running sums. A span costs a look at both ends and up to 31 pixels at each, however long it is.
class RowSums {
public:
    // The pixels are copied. `bins` per channel: 0 for no histogram.
    RowSums(const Picture& picture, int bins);

    int height() const { return height_; }
    int width() const { return width_; }
    std::size_t length() const { return 1 + moments_ + bins_; }

    Totals over(const Spans& spans) const;
    // Adds the sums of one span.
    void add(const Span& span, Totals& totals) const;

private:
    template <int C>
    void fill();
    template <int C>
    void add_span(const Span& span, std::int64_t* totals) const;
    template <int C>
    void add_pixels(const std::uint8_t* pixel, int count, std::int64_t sign, std::int64_t* totals) const;
    void add_before(int y, int block, std::int64_t sign, std::int64_t* totals) const;
    template <int C>
    int bin_of(const std::uint8_t* pixel) const;

    const std::uint8_t* at(int y, int x) const {
        return pixels_.data() + (static_cast<std::size_t>(y) * width_ + x) * channels_;
    }

    int height_, width_, channels_, levels_;
    std::size_t blocks_;   // of a row
    std::size_t moments_;  // sums and products
    std::size_t bins_;     // of the joint histogram
    std::vector<std::uint8_t> pixels_;
    std::vector<std::uint32_t> before_;        // [row][block][moment], of the pixels left of the block
    std::vector<std::uint16_t> counts_before_;  // [row][block][bin]
};

}  // namespace ffseg::region
