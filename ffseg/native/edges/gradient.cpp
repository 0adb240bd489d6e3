#include "edges/gradient.hpp"

#include <algorithm>
#include <cstring>
#include <memory>
#include <vector>

#include "common/lanes.hpp"
#include "edges/sobel.hpp"

namespace ffseg::edges {
namespace {

// Whole vectors of pixels, so that no loop over a scratch row has a remainder.
constexpr int kLanes = 32;

int whole(int count) { return (count + kLanes - 1) / kLanes * kLanes; }

// Scratch rows one below the other, each with room before and after its pixels; the first pixel of each stands at the
// start of a cache line. Rows a multiple of 4096 bytes apart would drive each other out of the cache.
template <class T>
class Rows {
public:
    Rows(int rows, int width, int margin)
        : margin_(whole(margin)),
          stride_(apart(whole(width) + 2 * margin_)),
          data_(static_cast<std::size_t>(rows) * static_cast<std::size_t>(stride_) + kLine) {
        void* start = data_.data();
        std::size_t room = data_.size() * sizeof(T);
        first_ = static_cast<T*>(std::align(kLine, room - kLine, start, room)) + margin_;
    }
    T* operator[](int row) { return first_ + static_cast<std::ptrdiff_t>(row) * stride_; }

private:
    static constexpr std::size_t kLine = 64;
    static int apart(int stride) { return stride * static_cast<int>(sizeof(T)) % 4096 == 0 ? stride + kLanes : stride; }

    int margin_, stride_;
    std::vector<T> data_;
    T* first_;
};

// Repeat the first and the last of `width` pixels to both sides.
void replicate(std::uint16_t* row, int width, int margin) {
    std::fill(row - margin, row, row[0]);
    std::fill(row + width, row + whole(width) + margin, row[width - 1]);
}

// Whether the three channels of every pixel are equal: one then has the gradient of all.
FFSEG_CLONES
bool is_grey(const Picture& image) {
    bool grey = image.channels == 3;
    for (int y = 0; y < image.height && grey; ++y) {
        const std::uint8_t* const row = image.pixels + static_cast<std::ptrdiff_t>(y) * image.width * 3;
        int apart = 0;
        for (int x = 0; x < image.width; ++x) apart |= (row[3 * x] ^ row[3 * x + 1]) | (row[3 * x] ^ row[3 * x + 2]);
        grey = apart == 0;
    }
    return grey;
}

// The pass over the image. Each stage is some rows behind the one before it and keeps no more rows than the next needs.
class Pass {
public:
    Pass(const Picture& image, const Gaussian& kernel, std::uint16_t* gradient, std::uint8_t* ridges)
        : image_(image),
          kernel_(kernel),
          gradient_(gradient),
          ridges_(ridges),
          span_(whole(image.width)),
          ring_(2 * kernel.radius() + 1),
          channels_(is_grey(image) ? 1 : image.channels),
          wide_(1, image.width, kernel.radius()),
          across_(ring_ * channels_, image.width, 0),
          smoothed_(3 * channels_, image.width, 1),
          slopes_(2, image.width, 0),
          sizes_(4, image.width, 1),
          directions_(2, image.width, 0),
          above_(kernel.weights.size()),
          below_(kernel.weights.size()) {}

    void run() {
        const int height = image_.height;
        int taken = 0;
        for (int y = 0; y < height + 2; ++y) {
            for (; taken < std::min(y + kernel_.radius() + 1, height); ++taken) take(taken);
            if (y < height) smooth(y);
            if (y >= 1 && y <= height) find_gradient(y - 1);
            if (y >= 2) find_ridges(y - 2);
        }
    }

private:
    static constexpr int kOutside = 3;  // the row of zeros round the gradient

    // Smooth a row of the image to both sides.
    void take(int y) {
        const std::uint8_t* row = image_.pixels + static_cast<std::ptrdiff_t>(y) * image_.width * image_.channels;
        for (int c = 0; c < channels_; ++c) {
            widen_row(row + c, image_.channels, wide_[0], image_.width);
            replicate(wide_[0], image_.width, kernel_.radius());
            smooth_across(wide_[0], kernel_, across_[y % ring_ * channels_ + c], span_);
        }
    }

    void smooth(int y) {
        for (int c = 0; c < channels_; ++c) {
            for (int k = 0; k <= kernel_.radius(); ++k) {
                const auto at = static_cast<std::size_t>(k);
                above_[at] = across_[std::max(y - k, 0) % ring_ * channels_ + c];
                below_[at] = across_[std::min(y + k, image_.height - 1) % ring_ * channels_ + c];
            }
            std::uint16_t* row = smoothed_[y % 3 * channels_ + c];
            smooth_down(above_.data(), below_.data(), kernel_, row, span_);
            replicate(row, image_.width, 1);
        }
    }

    void find_gradient(int y) {
        const int width = image_.width;
        const int before = std::max(y - 1, 0) % 3, after = std::min(y + 1, image_.height - 1) % 3;
        const auto rows = [&](int c) -> ThreeRows {
            return {smoothed_[before * channels_ + c], smoothed_[y % 3 * channels_ + c],
                    smoothed_[after * channels_ + c]};
        };
        std::uint16_t* row = sizes_[y % 3];
        const GradientRow out{row, directions_[y % 2]};
        if (channels_ == 1) {
            gradient_row(rows(0), out, span_);
        } else {
            const SlopeRow slope{slopes_[0], slopes_[1]};
            slope_row(rows(0), slope, span_);
            for (int c = 1; c < channels_; ++c) keep_steeper(rows(c), slope, span_);
            gradient_row(slope, out, span_);
        }
        row[width] = 0;
        std::memcpy(gradient_ + static_cast<std::ptrdiff_t>(y) * width, row,
                    sizeof(*row) * static_cast<std::size_t>(width));
    }

    void find_ridges(int y) {
        const ThreeRows rows{sizes_[y > 0 ? (y - 1) % 3 : kOutside], sizes_[y % 3],
                             sizes_[y + 1 < image_.height ? (y + 1) % 3 : kOutside]};
        ridge_row(rows, directions_[y % 2], ridges_ + static_cast<std::ptrdiff_t>(y) * image_.width, image_.width);
    }

    const Picture& image_;
    const Gaussian& kernel_;
    std::uint16_t* gradient_;
    std::uint8_t* ridges_;
    int span_, ring_, channels_;
    Rows<std::uint16_t> wide_, across_, smoothed_;
    Rows<std::int16_t> slopes_;
    Rows<std::uint16_t> sizes_, directions_;
    std::vector<const std::uint16_t*> above_, below_;
};

}  // namespace

void gradient_and_ridges(const Picture& image, const Gaussian& kernel, std::uint16_t* gradient, std::uint8_t* ridges) {
    Pass(image, kernel, gradient, ridges).run();
}

}  // namespace ffseg::edges
