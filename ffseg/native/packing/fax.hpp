// Whether the rows of a fax (ITU-T T.4 and T.6, as TIFF stores them) are whole.
#pragma once
#include <string_view>

namespace ffseg::packing {

struct FaxKind {
    enum Coding { kRunLengths, kGroup3, kGroup4 } coding = kGroup4;
    bool two_dimensional = false;  // group 3 only: rows may refer to the row before
};

// True when the data holds `rows` rows, each exactly `width` pixels long, and nothing but end codes behind them.
bool fax_is_whole(std::string_view data, int width, int rows, FaxKind kind);

}  // namespace ffseg::packing
