// Sums of colours over sets of pixels, from sums along the rows kept at every 32nd column.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/picture.hpp"
#include "raster/raster.hpp"

namespace ffseg::region {

using raster::Span;

// Spans in order of row and column that do not touch: a set of pixels of an image.
using Spans = std::vector<Span>;

// Exact sums over a set: first the number of pixels, then each channel's sum, then the products of channels
// (0 0, 0 1, .., 1 1, ..).
using Totals = std::vector<std::int64_t>;

// An image and its running sums. A span costs a look at both ends and up to 31 pixels at each, however long it is.
class RowSums {
public:
    // The pixels are copied.
    explicit RowSums(const Picture& picture);

    int height() const { return height_; }
    int width() const { return width_; }
    std::size_t length() const { return 1 + moments_; }

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

    const std::uint8_t* at(int y, int x) const {
        return pixels_.data() + (static_cast<std::size_t>(y) * width_ + x) * channels_;
    }

    int height_, width_, channels_;
    std::size_t blocks_;   // of a row
    std::size_t moments_;  // sums and products
    std::vector<std::uint8_t> pixels_;
    std::vector<std::uint32_t> before_;  // [row][block][moment], of the pixels left of the block
};

}  // namespace ffseg::region
