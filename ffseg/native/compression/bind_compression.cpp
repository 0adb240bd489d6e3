// Whether the compressed rows of a TIFF are whole: how long they become, without unpacking them.
#include <array>
#include <string_view>

#include "bindings.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

constexpr std::uint32_t kClear = 256, kEnd = 257, kFirstFree = 258, kTable = 4096;
constexpr unsigned kFirstWidth = 9, kLastWidth = 12;

// The code of `width` bits at a bit of the data, the highest of each byte first; the end code beyond.
std::uint32_t code_at(std::string_view data, std::size_t bit, unsigned width) {
    if (bit + width > 8 * data.size()) return kEnd;
    std::uint32_t word = 0;
    for (std::size_t i = bit / 8; i < bit / 8 + 4; ++i) {
        word = word << 8 | (i < data.size() ? static_cast<unsigned char>(data[i]) : 0U);
    }
    return (word << bit % 8) >> (32 - width);
}

std::int64_t lzw_size(const nb::bytes& bytes) {
    const std::string_view data(bytes.c_str(), bytes.size());
    nb::gil_scoped_release release;
    if (code_at(data, 0, kFirstWidth) != kClear) return -1;
    std::array<std::int64_t, kTable> lengths{};  // of what the codes stand for
    lengths.fill(1);
    std::uint32_t next = kFirstFree;
    unsigned width = kFirstWidth;
    std::int64_t total = 0, previous = 0;  // length of the string before; 0 after a clear code
    for (std::size_t bit = 0;;) {
        const std::uint32_t code = code_at(data, bit, width);
        if (code == kEnd) return total;  // some writers leave the end code out
        bit += width;
        if (code == kClear) {
            next = kFirstFree;
            width = kFirstWidth;
            previous = 0;
            continue;
        }
        if (code > next || (code > kClear && previous == 0)) return -1;
        const std::int64_t length = code == next ? previous + 1 : lengths[code];
        if (previous > 0 && next < kTable) {  // a full table stays as it is, at the last width
            lengths[next++] = previous + 1;
            if (next == (1U << width) - 1 && width < kLastWidth) ++width;
        }
        total += length;
        previous = length;
    }
}

std::int64_t packbits_size(const nb::bytes& bytes) {
    const std::string_view data(bytes.c_str(), bytes.size());
    nb::gil_scoped_release release;
    std::int64_t total = 0;
    std::size_t at = 0;
    while (at + 1 < data.size()) {  // a single byte left over is padding
        const int head = static_cast<signed char>(data[at]);
        if (head != -128) total += head >= 0 ? head + 1 : 1 - head;
        at += head == -128 ? 1 : head >= 0 ? static_cast<std::size_t>(head) + 2 : 2;
    }
    return at > data.size() ? -1 : total;
}

}  // namespace

void bind_compression(nb::module_& m) {
    m.def("lzw_size", &lzw_size, "data"_a,
          "Bytes that TIFF's LZW codes stand for; -1 when a code has no meaning where it stands.");
    m.def("packbits_size", &packbits_size, "data"_a,
          "Bytes that PackBits runs stand for; -1 when a run goes beyond the end.");
}
