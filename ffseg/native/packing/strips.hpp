// Whether packed rows of an image are whole: how long they become, without unpacking them.
#pragma once
#include <cstdint>
#include <string_view>

namespace ffseg::packing {

// Bytes that TIFF's LZW codes stand for (highest bit first, the width grows one code early); -1 when a code has no
// meaning where it stands.
std::int64_t lzw_size(std::string_view data);

// Bytes that PackBits runs stand for; -1 when a run goes beyond the end. A single byte left over is padding.
std::int64_t packbits_size(std::string_view data);

}  // namespace ffseg::packing
