#include "evidence/lab.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/lanes.hpp"

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

FFSEG_PART inline float looked_up(const float* table, float value) {
    const float place = std::min(std::max(value, 0.0F), 1.0F) * kSteps;
    const int at = static_cast<int>(place);
    return table[at] + (place - static_cast<float>(at)) * (table[at + 1] - table[at]);
}

// sRGB to XYZ over the white point D65; each row sums to 1.
constexpr float kToX[3] = {0.4339530F, 0.3762190F, 0.1898280F};
constexpr float kToY[3] = {0.2126710F, 0.7151600F, 0.0721690F};
constexpr float kToZ[3] = {0.0177576F, 0.1094769F, 0.8727655F};

FFSEG_CLONES
void add_bytes(const std::uint8_t* bytes, std::size_t count, std::uint16_t* sums) {
    FFSEG_APART
    for (std::size_t i = 0; i < count; ++i) sums[i] = static_cast<std::uint16_t>(sums[i] + bytes[i]);
}

// Sums over the rows of a row of blocks, one a byte; there are `rows` of them, at most 256.
struct Columns {
    std::vector<std::uint16_t> sums;
    int rows = 0;

    void take(const Picture& image, int first, int factor) {
        sums.assign(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.channels), 0);
        rows = std::min(factor, image.height - first);
        const std::uint8_t* row =
            image.pixels + static_cast<std::ptrdiff_t>(first) * static_cast<std::ptrdiff_t>(sums.size());
        for (int k = 0; k < rows; ++k, row += sums.size()) add_bytes(row, sums.size(), sums.data());
    }
};

// Sums of blue, green and red over some pixels.
struct Sums {
    unsigned of[3] = {0, 0, 0};
    int count = 0;
};

Sums sums_of(const Columns& columns, const Picture& image, int factor, int x) {
    const int x1 = std::min(x + factor, image.width);
    Sums sums;
    const int green = image.channels == 1 ? 0 : 1, red = image.channels == 1 ? 0 : 2;
    const std::uint16_t* at = columns.sums.data() + static_cast<std::ptrdiff_t>(x) * image.channels;
    for (int column = x; column < x1; ++column, at += image.channels) {
        sums.of[0] += at[0];
        sums.of[1] += at[green];
        sums.of[2] += at[red];
    }
    sums.count = columns.rows * (x1 - x);
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
        return looked_up(light.data(), static_cast<float>(sum) * scale);
    }

    int count_;
    std::vector<float> lights_;
};

FFSEG_PART inline float weighed(const float* weights, float red, float green, float blue) {
    return weights[0] * red + weights[1] * green + weights[2] * blue;
}

// Linear light of a row of the reduced image.
struct Row {
    Plane blue, green, red;
};

// L, a and b of a row; `roots` is the table of cube roots.
FFSEG_CLONES
void lab_of_row(const Row& row, const float* roots, int width, float* light, float* a, float* b) {
    const float *blue = row.blue.data(), *green = row.green.data(), *red = row.red.data();
    FFSEG_APART
    for (int x = 0; x < width; ++x) {
        const float fx = looked_up(roots, weighed(kToX, red[x], green[x], blue[x]));
        const float fy = looked_up(roots, weighed(kToY, red[x], green[x], blue[x]));
        const float fz = looked_up(roots, weighed(kToZ, red[x], green[x], blue[x]));
        light[x] = 116 * fy - 16;
        a[x] = 500 * (fx - fy);
        b[x] = 200 * (fy - fz);
    }
}

}  // namespace

Size reduced(const Picture& image, int factor) {
    return {(image.height + factor - 1) / factor, (image.width + factor - 1) / factor};
}

void reduced_lab(const Picture& image, int factor, float* lab) {
    static const Table roots = tabled(root);
    const Light light(factor * factor);
    const Size size = reduced(image, factor);
    const std::size_t count = size.count();
    const auto width = static_cast<std::size_t>(size.width);
    Row row{Plane(width), Plane(width), Plane(width)};
    Columns columns;
    for (int y = 0; y < size.height; ++y) {
        columns.take(image, y * factor, factor);
        for (int x = 0; x < size.width; ++x) {
            const Sums sums = sums_of(columns, image, factor, x * factor);
            const auto at = static_cast<std::size_t>(x);
            row.blue[at] = light.of(sums.of[0], sums.count);
            row.green[at] = light.of(sums.of[1], sums.count);
            row.red[at] = light.of(sums.of[2], sums.count);
        }
        float* to = lab + static_cast<std::size_t>(y) * width;
        lab_of_row(row, roots.data(), size.width, to, to + count, to + 2 * count);
    }
}

}  // namespace ffseg::evidence
