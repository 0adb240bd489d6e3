#include "packing/strips.hpp"

#include <array>

#include "packing/bits.hpp"

namespace ffseg::packing {

namespace {

constexpr std::uint32_t kClear = 256, kEnd = 257, kFirstFree = 258, kTable = 4096;
constexpr unsigned kFirstWidth = 9, kLastWidth = 12;

// What the codes of the table stand for, as lengths.
struct Table {
    std::array<std::int64_t, kTable> lengths{};
    std::uint32_t next = kFirstFree;
    unsigned width = kFirstWidth;

    void clear() {
        next = kFirstFree;
        width = kFirstWidth;
    }

    std::int64_t length(std::uint32_t code) const { return code < kClear ? 1 : lengths[code]; }

    // A full table stays as it is, at the last width.
    void add(std::int64_t length) {
        if (next == kTable) return;
        lengths[next++] = length;
        if (next == (1U << width) - 1 && width < kLastWidth) ++width;
    }
};

}  // namespace

std::int64_t lzw_size(std::string_view data) {
    BitReader bits(data);
    Table table;
    std::int64_t total = 0, previous = 0;  // length of the string before; 0 after a clear code
    if (bits.left() < kFirstWidth || bits.peek(kFirstWidth) != kClear) return -1;
    while (true) {
        const std::uint32_t code = bits.peek(table.width);
        if (!bits.skip(table.width) || code == kEnd) return total;  // some writers leave the end code out
        if (code == kClear) {
            table.clear();
            previous = 0;
            continue;
        }
        if (code > table.next || (code >= kClear && previous == 0)) return -1;
        const bool fresh = code == table.next;
        const std::int64_t length = fresh ? previous + 1 : table.length(code);
        if (previous > 0) table.add(previous + 1);
        total += length;
        previous = length;
    }
}

std::int64_t packbits_size(std::string_view data) {
    std::int64_t total = 0;
    std::size_t at = 0;
    while (at + 1 < data.size()) {
        const int head = static_cast<signed char>(data[at]);
        const bool literal = head >= 0;
        if (head != -128) total += literal ? head + 1 : 1 - head;
        at += head == -128 ? 1 : literal ? static_cast<std::size_t>(head) + 2 : 2;
    }
    return at > data.size() ? -1 : total;
}

}  // namespace ffseg::packing
