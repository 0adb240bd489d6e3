#include "evidence/lab.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace ffseg::evidence {
namespace {

// Steps of the tables; between them lines are drawn. The error stays below 2e-4 in L, a and b.
constexpr int kSteps = 4096;

using Table = std::array<float, kSteps + 2>;

// From sRGB to linear light, both from 0 to 1.
double linear(double value) { return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4); }

// CIE 1976: the cube root with a straight foot.
double root(double value) { return value > 216.0 / 24389.0 ? std::cbrt(value) : (24389.0 / 27.0 * value + 16) / 116; }

template <class Function>
Table tabled(Function function) {
    Table table{};
    for (int i = 0; i < kSteps + 2; ++i)
        table[static_cast<std::size_t>(i)] = static_cast<float>(function(i / double{kSteps}));
    return table;
}

float looked_up(const Table& table, float value) {
    const float place = std::clamp(value, 0.0F, 1.0F) * kSteps;
    const int at = static_cast<int>(place);
    const float low = table[static_cast<std::size_t>(at)], high = table[static_cast<std::size_t>(at) + 1];
    return low + (place - static_cast<float>(at)) * (high - low);
}

// sRGB to XYZ over the white point D65; each row sums to 1.
constexpr float kToX[3] = {0.4339530F, 0.3762190F, 0.1898280F};
constexpr float kToY[3] = {0.2126710F, 0.7151600F, 0.0721690F};
constexpr float kToZ[3] = {0.0177576F, 0.1094769F, 0.8727655F};

// Sums of blue, green and red over some pixels.
struct Sums {
    unsigned of[3] = {0, 0, 0};
    int count = 0;
};

Sums sums_of(const Pixels& image, int factor, int y, int x) {
    const int y1 = std::min(y + factor, image.height), x1 = std::min(x + factor, image.width);
    Sums sums;
    const int green = image.channels == 1 ? 0 : 1, red = image.channels == 1 ? 0 : 2;
    for (int row = y; row < y1; ++row) {
        const std::uint8_t* at = image.data + (static_cast<std::ptrdiff_t>(row) * image.width + x) * image.channels;
        for (int column = x; column < x1; ++column, at += image.channels) {
            sums.of[0] += at[0];
            sums.of[1] += at[green];
            sums.of[2] += at[red];
        }
    }
    sums.count = (y1 - y) * (x1 - x);
    return sums;
}

// Linear light of means, by their sums: looked up once for whole blocks, those at the far borders are smaller.
class Light {
public:
    explicit Light(int count) : count_(count), lights_(static_cast<std::size_t>(255 * count) + 1) {
        for (std::size_t sum = 0; sum < lights_.size(); ++sum)
            lights_[sum] = of_mean(static_cast<unsigned>(sum), count);
    }
    float of(unsigned sum, int count) const { return count == count_ ? lights_[sum] : of_mean(sum, count); }

private:
    static float of_mean(unsigned sum, int count) {
        static const Table light = tabled(linear);
        const float scale = 1.0F / (255.0F * static_cast<float>(count));
        return looked_up(light, static_cast<float>(sum) * scale);
    }

    int count_;
    std::vector<float> lights_;
};

float weighed(const float* weights, float red, float green, float blue) {
    return weights[0] * red + weights[1] * green + weights[2] * blue;
}

}  // namespace

Size reduced(const Pixels& image, int factor) {
    return {(image.height + factor - 1) / factor, (image.width + factor - 1) / factor};
}

void reduced_lab(const Pixels& image, int factor, float* lab) {
    static const Table roots = tabled(root);
    const Light light(factor * factor);
    const Size size = reduced(image, factor);
    const std::size_t count = size.count();
    std::size_t at = 0;
    for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x, ++at) {
            const Sums sums = sums_of(image, factor, y * factor, x * factor);
            const float blue = light.of(sums.of[0], sums.count), green = light.of(sums.of[1], sums.count);
            const float red = light.of(sums.of[2], sums.count);
            const float fx = looked_up(roots, weighed(kToX, red, green, blue));
            const float fy = looked_up(roots, weighed(kToY, red, green, blue));
            const float fz = looked_up(roots, weighed(kToZ, red, green, blue));
            lab[at] = 116 * fy - 16;
            lab[count + at] = 500 * (fx - fy);
            lab[2 * count + at] = 200 * (fy - fz);
        }
    }
}

}  // namespace ffseg::evidence
