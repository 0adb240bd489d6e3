// Bits of a byte string, the highest of each byte first.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace ffseg::packing {

class BitReader {
public:
    explicit BitReader(std::string_view data) : data_(data) {}

    std::size_t left() const { return 8 * data_.size() - at_; }

    // The next `count` <= 24 bits; zeros stand behind the end.
    std::uint32_t peek(unsigned count) const {
        std::uint32_t word = 0;
        const std::size_t first = at_ / 8;
        for (std::size_t i = first; i < first + 4; ++i) {
            word = word << 8 | (i < data_.size() ? static_cast<unsigned char>(data_[i]) : 0U);
        }
        return (word << at_ % 8) >> (32 - count);
    }

    // False, and nothing is skipped, when fewer bits are left.
    bool skip(std::size_t count) {
        if (count > left()) return false;
        at_ += count;
        return true;
    }

    void skip_to_byte() { at_ = (at_ + 7) / 8 * 8; }

private:
    std::string_view data_;
    std::size_t at_ = 0;
};

}  // namespace ffseg::packing
