// Code words of fax runs (ITU-T T.4, tables 2 and 3).
#pragma once
#include <cstdint>
#include <vector>

#include "packing/bits.hpp"

namespace ffseg::packing {

constexpr unsigned kLongestRunCode = 13;

struct RunCode {
    std::int16_t run = -1;  // pixels; -1 where no code word begins so
    std::uint8_t bits = 0;
};

// By the next 13 bits: the code words of white or of black runs.
const std::vector<RunCode>& run_codes(bool black);

// Length of a run: any number of make-up codes, then a terminating one; -1 when a code word has no meaning.
int read_run(BitReader& bits, bool black, int most);

}  // namespace ffseg::packing
