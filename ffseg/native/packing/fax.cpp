#include "packing/fax.hpp"

#include <algorithm>
#include <vector>

#include "packing/fax_codes.hpp"

namespace ffseg::packing {

namespace {

// Places where the colour of a row changes, the first to black; those at `width` pad its end.
using Changes = std::vector<int>;
constexpr int kPadding = 4;

constexpr unsigned kEolBits = 12;

// Fill bits and an end-of-line code, if they come next.
bool skip_eol(BitReader& bits) {
    BitReader ahead = bits;
    if (ahead.left() < kEolBits || ahead.peek(kEolBits - 1) != 0) return false;
    while (ahead.left() > 0 && ahead.peek(1) == 0) ahead.skip(1);
    if (!ahead.skip(1)) return false;
    bits = ahead;
    return true;
}

bool read_plain_row(BitReader& bits, int width, Changes& row) {
    int at = 0;
    bool black = false;
    while (at < width) {
        const int run = read_run(bits, black, width - at);
        if (run < 0) return false;
        at += run;
        row.push_back(at);
        black = !black;
    }
    return true;
}

enum class Mode { kPass, kHorizontal, kVertical, kNone };

struct ModeCode {
    std::uint32_t word;
    unsigned bits;
    Mode mode;
    int shift;
};

// T.6, table 1.
constexpr ModeCode kModes[] = {
    {0b1, 1, Mode::kVertical, 0},       {0b011, 3, Mode::kVertical, 1},     {0b010, 3, Mode::kVertical, -1},
    {0b001, 3, Mode::kHorizontal, 0},   {0b0001, 4, Mode::kPass, 0},        {0b000011, 6, Mode::kVertical, 2},
    {0b000010, 6, Mode::kVertical, -2}, {0b0000011, 7, Mode::kVertical, 3}, {0b0000010, 7, Mode::kVertical, -3},
};

ModeCode read_mode(BitReader& bits) {
    for (const ModeCode& code : kModes) {
        if (bits.peek(code.bits) == code.word && bits.skip(code.bits)) return code;
    }
    return {0, 0, Mode::kNone, 0};
}

// One row coded by its differences from the row before.
class Follower {
public:
    Follower(const Changes& before, int width, Changes& row) : before_(before), width_(width), row_(row) {}

    bool read(BitReader& bits) {
        while (at_ < width_) {
            const ModeCode code = read_mode(bits);
            if (code.mode == Mode::kNone || !step(bits, code)) return false;
        }
        return true;
    }

private:
    bool step(BitReader& bits, const ModeCode& code) {
        if (code.mode == Mode::kHorizontal) return horizontal(bits);
        find();
        if (code.mode == Mode::kPass) {
            at_ = before_[b_ + 1];
            return true;
        }
        const int change = before_[b_] + code.shift;
        if (change < std::max(at_, 0) || change > width_) return false;
        row_.push_back(change);
        at_ = change;
        black_ = !black_;
        return true;
    }

    bool horizontal(BitReader& bits) {
        at_ = std::max(at_, 0);
        for (const bool black : {black_, !black_}) {
            const int run = read_run(bits, black, width_ - at_);
            if (run < 0) return false;
            at_ += run;
            row_.push_back(at_);
        }
        return true;
    }

    // The first change of the row before that lies behind `at_` and leads to the other colour.
    void find() {
        b_ -= std::min<std::size_t>(b_, 2);
        if ((b_ % 2 == 1) != black_) ++b_;
        while (before_[b_] <= at_ && before_[b_] < width_) b_ += 2;
    }

    const Changes& before_;
    const int width_;
    Changes& row_;
    std::size_t b_ = 0;
    int at_ = -1;
    bool black_ = false;
};

bool read_row(BitReader& bits, int width, const Changes& before, bool follows, Changes& row) {
    row.clear();
    const bool whole = follows ? Follower(before, width, row).read(bits) : read_plain_row(bits, width, row);
    row.insert(row.end(), kPadding, width);
    return whole;
}

// Only end-of-line codes, with their tag bits, and zeros are left.
bool only_ends(BitReader& bits, bool tagged) {
    while (skip_eol(bits)) {
        if (tagged) bits.skip(1);
    }
    while (bits.left() >= 16) {
        if (bits.peek(16) != 0) return false;
        bits.skip(16);
    }
    return bits.left() == 0 || bits.peek(static_cast<unsigned>(bits.left())) == 0;
}

}  // namespace

bool fax_is_whole(std::string_view data, int width, int rows, FaxKind kind) {
    BitReader bits(data);
    Changes before(kPadding, width), row;
    const bool group3 = kind.coding == FaxKind::kGroup3;
    for (int i = 0; i < rows; ++i) {
        bool follows = kind.coding == FaxKind::kGroup4;
        if (group3) {
            const bool marked = skip_eol(bits);
            if (!marked && (i > 0 || kind.two_dimensional)) return false;
            if (kind.two_dimensional) {
                follows = bits.peek(1) == 0;
                bits.skip(1);
            }
        }
        if (!read_row(bits, width, before, follows, row)) return false;
        if (kind.coding == FaxKind::kRunLengths) bits.skip_to_byte();
        before.swap(row);
    }
    return only_ends(bits, group3 && kind.two_dimensional);
}

}  // namespace ffseg::packing
