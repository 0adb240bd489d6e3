// Sets of pixels as bits, 64 at a time: dilations and floods cost a fraction of a distance transform.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace ffseg::field {

class Bitmap {
public:
    using Word = std::uint64_t;
    static constexpr int kBits = 64;

    Bitmap(int height, int width)
        : height_(height),
          words_((static_cast<std::size_t>(width) + kBits - 1) / kBits),
          data_(static_cast<std::size_t>(height) * words_) {}

    int height() const { return height_; }
    std::size_t words() const { return words_; }
    Word* row(int y) { return data_.data() + static_cast<std::size_t>(y) * words_; }
    const Word* row(int y) const { return data_.data() + static_cast<std::size_t>(y) * words_; }
    bool holds(int x, int y) const { return (row(y)[x / kBits] >> (x % kBits) & 1) != 0; }
    void add(int x, int y) { row(y)[x / kBits] |= Word{1} << (x % kBits); }
    bool empty() const;

    // Both must be of one size.
    void keep(const Bitmap& other);
    void remove(const Bitmap& other);
    void add(const Bitmap& other);

    // All pixels nearer than `radius` to one of these. Bits beyond the width may be set in the last word.
    Bitmap grown(double radius) const;
    // The pixels of `open` that are 8-connected with these.
    Bitmap flooded(const Bitmap& open) const;

private:
    void fill_row(int y, const Bitmap& open);
    bool spill(int from, int to, const Bitmap& open);

    int height_;
    std::size_t words_;
    std::vector<Word> data_;
};

}  // namespace ffseg::field
