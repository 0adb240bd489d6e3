#include "evidence/texture.hpp"

#include <algorithm>
#include <cmath>

#include "common/lanes.hpp"
#include "evidence/blur.hpp"

namespace ffseg::evidence {
namespace {

// Three rows with a pixel repeated at both ends, going down a plane.
class Window {
public:
    Window(const float* plane, Size size)
        : plane_(plane), size_(size), rows_{Plane(size_of(size)), Plane(size_of(size)), Plane(size_of(size))} {
        take(0, rows_[1]);
        take(1, rows_[2]);
        rows_[0] = rows_[1];
    }

    // The next row becomes the one in the middle.
    void move_to(int y) {
        if (y == 0) return;
        rows_[0].swap(rows_[1]);
        rows_[1].swap(rows_[2]);
        take(y + 1, rows_[2]);
    }
    const float* operator[](int k) const { return rows_[k].data() + 1; }

private:
    static std::size_t size_of(Size size) { return static_cast<std::size_t>(size.width) + 2; }
    void take(int y, Plane& to) const {
        const float* row = plane_ + static_cast<std::ptrdiff_t>(std::min(y, size_.height - 1)) * size_.width;
        to.front() = row[0];
        std::copy(row, row + size_.width, to.begin() + 1);
        to.back() = row[size_.width - 1];
    }

    const float* plane_;
    Size size_;
    Plane rows_[3];
};

struct Slope {
    float across, down;
};

FFSEG_PART inline Slope slope_at(const float* above, const float* here, const float* below, int x) {
    const float left = (above[x - 1] + below[x - 1]) + 2 * here[x - 1];
    const float right = (above[x + 1] + below[x + 1]) + 2 * here[x + 1];
    const float up = (above[x - 1] + above[x + 1]) + 2 * above[x];
    const float down = (below[x - 1] + below[x + 1]) + 2 * below[x];
    return {(right - left) * 0.125F, (down - up) * 0.125F};
}

FFSEG_CLONES
void slope_rows(const float* above, const float* here, const float* below, float* gx, float* gy, int count) {
    FFSEG_APART
    for (int x = 0; x < count; ++x) {
        const Slope slope = slope_at(above, here, below, x);
        gx[x] = slope.across;
        gy[x] = slope.down;
    }
}

// Adds the squares of slopes that nothing else is asked of.
FFSEG_CLONES
void square_rows(const float* above, const float* here, const float* below, float* sums, int count) {
    FFSEG_APART
    for (int x = 0; x < count; ++x) {
        const Slope slope = slope_at(above, here, below, x);
        sums[x] = sums[x] + (slope.across * slope.across + slope.down * slope.down);
    }
}

void slopes(const float* plane, Size size, Plane& gx, Plane& gy) {
    gx.resize(size.count());
    gy.resize(size.count());
    Window window(plane, size);
    for (int y = 0; y < size.height; ++y) {
        window.move_to(y);
        const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(y) * size.width;
        slope_rows(window[0], window[1], window[2], gx.data() + at, gy.data() + at, size.width);
    }
}

void add_squares(const float* plane, Size size, float* sums) {
    Window window(plane, size);
    for (int y = 0; y < size.height; ++y) {
        window.move_to(y);
        square_rows(window[0], window[1], window[2], sums + static_cast<std::ptrdiff_t>(y) * size.width, size.width);
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

// L, a, b smoothed, and the squares of their gradients: of light, and of colour.
void smooth(const float* lab, Size size, double sigma, float* out, float* light, float* colour) {
    const std::size_t count = size.count();
    std::fill(light, light + count, 0.0F);
    std::fill(colour, colour + count, 0.0F);
    for (std::size_t c = 3; c-- > 0;) {
        blur(lab + c * count, size, sigma, out + c * count);
        add_squares(out + c * count, size, c == 0 ? light : colour);
    }
}

}  // namespace

void texture(const float* lab, Size size, double sigma, float* out) {
    const std::size_t count = size.count();
    const auto plane = [&](int index) { return out + static_cast<std::size_t>(index) * count; };
    Plane gx, gy, xx(count), xy(count), yy(count);
    smooth(lab, size, sigma, out, plane(3), plane(4));
    slopes(out, size, gx, gy);
    sizes(plane(3), plane(4), plane(5), count);
    products(gx.data(), gx.data(), xx.data(), count);
    products(gx.data(), gy.data(), xy.data(), count);
    products(gy.data(), gy.data(), yy.data(), count);
    for (Plane* one : {&xx, &xy, &yy}) blur(one->data(), size, 2 * sigma, one->data());
    eigenvalues(xx.data(), xy.data(), yy.data(), plane(6), plane(7), count);
}

void colour(const float* lab, Size size, double sigma, float* out) {
    const std::size_t count = size.count();
    Plane light(count), tint(count);
    smooth(lab, size, sigma, out, light.data(), tint.data());
    sizes(light.data(), tint.data(), out + 3 * count, count);
}

}  // namespace ffseg::evidence
