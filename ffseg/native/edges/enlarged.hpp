// What tells a picture that was enlarged: lines that interpolation between fewer pixels can make.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace ffseg::edges {

// A channel of a picture, or the same turned on its side; steps are in bytes.
struct Lines {
    const std::uint8_t* first;
    std::size_t count, length;
    std::ptrdiff_t down, along;
};

// Of every `step`-th line the `most` that change most between every `skip`-th pixels, one after the other.
std::vector<float> liveliest(const Lines& lines, std::size_t most, std::size_t step, std::size_t skip);

// What takes from `size` pixels all that each of some kinds of interpolation can make between one in `factor` of them:
// a matrix of `size` rows, the columns of one kind after those of another.
struct Rest {
    const float* weights;
    std::size_t size, kinds, factor;
};

// The share of pixels in lines that each kind cannot make up to `rounded`, of those that differ by more from that
// `factor` beside; infinite where none does. Once no kind can come below `most`, no more pixels are looked at.
std::vector<double> amiss(const float* lines, std::size_t count, std::size_t length, const Rest& rest, float rounded,
                          double most);

}  // namespace ffseg::edges
