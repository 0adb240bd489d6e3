#include "evidence/texture.hpp"

#include <algorithm>
#include <cmath>

#include "common/lanes.hpp"
#include "evidence/blur.hpp"

namespace ffseg::evidence {
namespace {

// Three rows with a pixel repeated at both ends.
class Window {
public:
    explicit Window(int width) : rows_{Plane(size_of(width)), Plane(size_of(width)), Plane(size_of(width))} {}

    void take(const float* plane, Size size, int y) {
        for (int k = 0; k < 3; ++k) {
            const int from = std::clamp(y + k - 1, 0, size.height - 1);
            const float* row = plane + static_cast<std::ptrdiff_t>(from) * size.width;
            Plane& to = rows_[k];
            to.front() = row[0];
            std::copy(row, row + size.width, to.begin() + 1);
            to.back() = row[size.width - 1];
        }
    }
    const float* operator[](int k) const { return rows_[k].data() + 1; }

private:
    static std::size_t size_of(int width) { return static_cast<std::size_t>(width) + 2; }
    Plane rows_[3];
};

FFSEG_CLONES
void slope_rows(const float* above, const float* here, const float* below, float* gx, float* gy, int count) {
    FFSEG_APART
    for (int x = 0; x < count; ++x) {
        const float left = (above[x - 1] + below[x - 1]) + 2 * here[x - 1];
        const float right = (above[x + 1] + below[x + 1]) + 2 * here[x + 1];
        const float up = (above[x - 1] + above[x + 1]) + 2 * above[x];
        const float down = (below[x - 1] + below[x + 1]) + 2 * below[x];
        gx[x] = (right - left) * 0.125F;
        gy[x] = (down - up) * 0.125F;
    }
}

void slopes(const float* plane, Size size, Plane& gx, Plane& gy) {
    gx.resize(size.count());
    gy.resize(size.count());
    Window window(size.width);
    for (int y = 0; y < size.height; ++y) {
        window.take(plane, size, y);
        const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(y) * size.width;
        slope_rows(window[0], window[1], window[2], gx.data() + at, gy.data() + at, size.width);
    }
}

// The eigenvalues of symmetric matrices (a, b; b, c), the larger first.
FFSEG_CLONES
void eigenvalues(const float* a, const float* b, const float* c, float* larger_one, float* smaller_one,
                 std::size_t count) {
    FFSEG_APART
    for (std::size_t i = 0; i < count; ++i) {
        const float mean = (a[i] + c[i]) * 0.5F, half = (a[i] - c[i]) * 0.5F;
        const float spread = std::sqrt(half * half + b[i] * b[i]);
        larger_one[i] = mean + spread;
        smaller_one[i] = mean - spread;
    }
}

FFSEG_CLONES
void add_squares(const float* gx, const float* gy, float* sums, std::size_t count) {
    FFSEG_APART
    for (std::size_t i = 0; i < count; ++i) sums[i] = sums[i] + (gx[i] * gx[i] + gy[i] * gy[i]);
}

FFSEG_CLONES
void products(const float* a, const float* b, float* out, std::size_t count) {
    FFSEG_APART
    for (std::size_t i = 0; i < count; ++i) out[i] = a[i] * b[i];
}

// The sizes of the gradients of light, of colour, and of both, of which the first two are given squared.
FFSEG_CLONES
void sizes(float* light, float* colour, float* both, std::size_t count) {
    FFSEG_APART
    for (std::size_t i = 0; i < count; ++i) {
        both[i] = std::sqrt(light[i] + colour[i]);
        light[i] = std::sqrt(light[i]);
        colour[i] = std::sqrt(colour[i]);
    }
}

// L, a, b smoothed, and the squares of their gradients: of light, and of colour. The slopes of L are left behind.
void smooth(const float* lab, Size size, double sigma, float* out, float* light, float* colour, Plane& gx, Plane& gy) {
    const std::size_t count = size.count();
    std::fill(light, light + count, 0.0F);
    std::fill(colour, colour + count, 0.0F);
    for (std::size_t c = 3; c-- > 0;) {
        float* plane = out + c * count;
        blur(lab + c * count, size, sigma, plane);
        slopes(plane, size, gx, gy);
        add_squares(gx.data(), gy.data(), c == 0 ? light : colour, count);
    }
}

}  // namespace

void texture(const float* lab, Size size, double sigma, float* out) {
    const std::size_t count = size.count();
    const auto plane = [&](int index) { return out + static_cast<std::size_t>(index) * count; };
    Plane gx, gy, hxx, hxy, unused, hyy;
    smooth(lab, size, sigma, out, plane(3), plane(4), gx, gy);
    sizes(plane(3), plane(4), plane(5), count);
    slopes(gx.data(), size, hxx, hxy);
    slopes(gy.data(), size, unused, hyy);
    eigenvalues(hxx.data(), hxy.data(), hyy.data(), plane(8), plane(9), count);
    products(gx.data(), gx.data(), hxx.data(), count);
    products(gx.data(), gy.data(), hxy.data(), count);
    products(gy.data(), gy.data(), hyy.data(), count);
    for (Plane* one : {&hxx, &hxy, &hyy}) blur(one->data(), size, 2 * sigma, one->data());
    eigenvalues(hxx.data(), hxy.data(), hyy.data(), plane(6), plane(7), count);
}

void colour(const float* lab, Size size, double sigma, float* out) {
    const std::size_t count = size.count();
    Plane gx, gy, light(count), tint(count);
    smooth(lab, size, sigma, out, light.data(), tint.data(), gx, gy);
    sizes(light.data(), tint.data(), out + 3 * count, count);
}

}  // namespace ffseg::evidence
