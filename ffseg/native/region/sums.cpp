#include "region/sums.hpp"

#include <algorithm>

namespace ffseg::region {
namespace {

// Columns between two kept sums. Sums of a row fit 32 bits: 65535 * 255 * 255 < 2^32.
constexpr int kBlock = 32;

}  // namespace

RowSums::RowSums(const Picture& picture)
    : height_(picture.height),
      width_(picture.width),
      channels_(picture.channels),
      blocks_(static_cast<std::size_t>(width_) / kBlock + 1),
      moments_(static_cast<std::size_t>(channels_ + channels_ * (channels_ + 1) / 2)),
      pixels_(picture.pixels, picture.pixels + static_cast<std::size_t>(height_) * width_ * channels_),
      before_(static_cast<std::size_t>(height_) * blocks_ * moments_) {
    by_channels(channels_, [this](auto channels) { fill<channels()>(); });
}

template <int C>
void RowSums::fill() {
    std::vector<std::int64_t> sums(length());
    for (int y = 0; y < height_; ++y) {
        std::fill(sums.begin(), sums.end(), 0);
        for (std::size_t block = 0; block < blocks_; ++block) {
            const std::size_t place = static_cast<std::size_t>(y) * blocks_ + block;
            for (std::size_t i = 0; i < moments_; ++i) {
                before_[place * moments_ + i] = static_cast<std::uint32_t>(sums[1 + i]);
            }
            const int x = static_cast<int>(block) * kBlock;
            add_pixels<C>(at(y, x), std::min(kBlock, width_ - x), 1, sums.data());
        }
    }
}

template <int C>
void RowSums::add_pixels(const std::uint8_t* pixel, int count, std::int64_t sign, std::int64_t* totals) const {
    std::uint32_t sums[C * (C + 3) / 2] = {};  // of fewer than kBlock pixels
    for (int i = 0; i < count; ++i, pixel += C) {
        std::uint32_t* next = sums + C;
        for (int c = 0; c < C; ++c) {
            sums[c] += pixel[c];
            for (int d = c; d < C; ++d) *next++ += static_cast<std::uint32_t>(pixel[c]) * pixel[d];
        }
    }
    for (std::size_t i = 0; i < moments_; ++i) totals[1 + i] += sign * static_cast<std::int64_t>(sums[i]);
}

void RowSums::add_before(int y, int block, std::int64_t sign, std::int64_t* totals) const {
    const std::size_t place = static_cast<std::size_t>(y) * blocks_ + static_cast<std::size_t>(block);
    const std::uint32_t* sums = before_.data() + place * moments_;
    for (std::size_t i = 0; i < moments_; ++i) totals[1 + i] += sign * static_cast<std::int64_t>(sums[i]);
}

template <int C>
void RowSums::add_span(const Span& span, std::int64_t* totals) const {
    totals[0] += span.end - span.begin;
    const int first = span.begin / kBlock, last = span.end / kBlock;
    if (last - first <= 1) {
        for (int x = span.begin; x < span.end; x += kBlock) {
            add_pixels<C>(at(span.y, x), std::min(kBlock, span.end - x), 1, totals);
        }
        return;
    }
    add_before(span.y, last, 1, totals);
    add_before(span.y, first, -1, totals);
    add_pixels<C>(at(span.y, last * kBlock), span.end - last * kBlock, 1, totals);
    add_pixels<C>(at(span.y, first * kBlock), span.begin - first * kBlock, -1, totals);
}

void RowSums::add(const Span& span, Totals& totals) const {
    by_channels(channels_, [&](auto channels) { add_span<channels()>(span, totals.data()); });
}

}  // namespace ffseg::region
