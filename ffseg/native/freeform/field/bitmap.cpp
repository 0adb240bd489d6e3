#include "freeform/field/bitmap.hpp"

#include <algorithm>
#include <cmath>

namespace ffseg::field {
namespace {

using Word = Bitmap::Word;
constexpr int kBits = Bitmap::kBits;

// row |= row moved by `by` pixels (less than a word) to either side.
void spread(const Word* row, std::size_t words, int by, Word* out) {
    for (std::size_t at = 0; at < words; ++at) {
        const Word before = at > 0 ? row[at - 1] : 0, after = at + 1 < words ? row[at + 1] : 0;
        out[at] = row[at] | row[at] << by | row[at] >> by | before >> (kBits - by) | after << (kBits - by);
    }
}

// Widens the runs of a row to `by` pixels on either side, after they have been widened by `known`.
void widen(std::vector<Word>& row, std::vector<Word>& spare, int known, int by) {
    while (by > 0) {
        const int step = std::min({by, 2 * known + 1, kBits - 1});
        spread(row.data(), row.size(), step, spare.data());
        row.swap(spare);
        known += step;
        by -= step;
    }
}

}  // namespace

bool Bitmap::empty() const {
    return std::all_of(data_.begin(), data_.end(), [](Word word) { return word == 0; });
}

void Bitmap::keep(const Bitmap& other) {
    for (std::size_t at = 0; at < data_.size(); ++at) data_[at] &= other.data_[at];
}

void Bitmap::remove(const Bitmap& other) {
    for (std::size_t at = 0; at < data_.size(); ++at) data_[at] &= ~other.data_[at];
}

void Bitmap::add(const Bitmap& other) {
    for (std::size_t at = 0; at < data_.size(); ++at) data_[at] |= other.data_[at];
}

// A row is widened step by step, from the half-width of the disc's topmost row to that of its middle.
Bitmap Bitmap::grown(double radius) const {
    Bitmap out(height_, static_cast<int>(words_) * kBits);
    const double square = radius * radius;
    const int most = static_cast<int>(std::ceil(radius)) - 1;
    std::vector<Word> wide(words_), spare(words_);
    for (int y = 0; y < height_; ++y) {
        if (std::all_of(row(y), row(y) + words_, [](Word word) { return word == 0; })) continue;
        std::copy_n(row(y), words_, wide.data());
        int known = 0;
        for (int dy = most; dy >= 0; --dy) {
            int half = static_cast<int>(std::sqrt(std::max(0.0, square - static_cast<double>(dy) * dy)));
            if (half * half + dy * dy >= square) --half;
            if (half < 0) continue;
            widen(wide, spare, known, half - known);
            known = half;
            for (const int to : {y - dy, y + dy}) {
                if (to < 0 || to >= height_) continue;
                Word* const sum = out.row(to);
                for (std::size_t at = 0; at < words_; ++at) sum[at] |= wide[at];
            }
        }
    }
    return out;
}

// Fills the runs of `open` that contain a pixel of this row: upwards by the carry of an addition, downwards by
// doubling.
void Bitmap::fill_row(int y, const Bitmap& open) {
    Word* const mine = row(y);
    const Word* const free = open.row(y);
    Word carry = 0;
    for (std::size_t at = 0; at < words_; ++at) {
        const Word from = mine[at] | (carry & free[at]);
        const Word filled = from | (free[at] & ~(free[at] + from));
        carry = filled >> (kBits - 1);
        mine[at] = filled;
    }
    carry = 0;
    for (std::size_t at = words_; at-- > 0;) {
        Word filled = mine[at] | (carry << (kBits - 1) & free[at]), way = free[at];
        for (int step = 1; step < kBits; step *= 2) {
            filled |= way & filled >> step;
            way &= way >> step;
        }
        carry = filled & 1;
        mine[at] = filled;
    }
}

// Adds the pixels of `open` in row `to` that touch pixels of row `from`. True if there are any.
bool Bitmap::spill(int from, int to, const Bitmap& open) {
    if (to < 0 || to >= height_) return false;
    const Word *const source = row(from), *const free = open.row(to);
    Word* const mine = row(to);
    Word added = 0;
    for (std::size_t at = 0; at < words_; ++at) {
        const Word before = at > 0 ? source[at - 1] : 0, after = at + 1 < words_ ? source[at + 1] : 0;
        const Word touched =
            source[at] | source[at] << 1 | source[at] >> 1 | before >> (kBits - 1) | after << (kBits - 1);
        const Word fresh = touched & free[at] & ~mine[at];
        added |= fresh;
        mine[at] |= fresh;
    }
    return added != 0;
}

// Sweeps down and up over the rows that have gained pixels.
Bitmap Bitmap::flooded(const Bitmap& open) const {
    Bitmap out = *this;
    out.keep(open);
    std::vector<std::uint8_t> changed(static_cast<std::size_t>(height_), 1);
    for (bool any = true, down = true; any; down = !down) {
        any = false;
        for (int at = 0; at < height_; ++at) {
            const int y = down ? at : height_ - 1 - at;
            if (changed[static_cast<std::size_t>(y)] == 0) continue;
            changed[static_cast<std::size_t>(y)] = 0;
            out.fill_row(y, open);
            for (const int to : {y - 1, y + 1}) {
                if (!out.spill(y, to, open)) continue;
                changed[static_cast<std::size_t>(to)] = 1;
                any = true;
            }
        }
    }
    return out;
}

}  // namespace ffseg::field
