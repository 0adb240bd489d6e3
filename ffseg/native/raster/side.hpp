// On which side of an edge a point lies, decided exactly.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>

#include "common/vec.hpp"

namespace ffseg::raster {

// A sum of float64 terms held as a non-overlapping expansion, smallest part first, so that its sign is exact.
// (Shewchuk 1997, grow-expansion.) Exact while no term underflows: |coordinates| within 1e-140 .. 1e140, or zero.
class ExactSum {
public:
    void add_product(double a, double b, double sign) {
        const double high = a * b;
        add(sign * high);
        add(sign * std::fma(a, b, -high));
    }

    int sign() const {
        for (std::size_t i = size_; i-- > 0;) {
            if (parts_[i] != 0.0) return parts_[i] > 0.0 ? 1 : -1;
        }
        return 0;
    }

private:
    void add(double term) {
        for (std::size_t i = 0; i < size_; ++i) {
            const double part = parts_[i], sum = term + part, virtual_part = sum - term;
            parts_[i] = (term - (sum - virtual_part)) + (part - virtual_part);
            term = sum;
        }
        parts_[size_++] = term;
    }

    std::array<double, 12> parts_{};
    std::size_t size_ = 0;
};

// Sign of (b - a) x (p - a), exact: for a.y < b.y it is +1 where p lies to the left (smaller x) of the line ab.
inline int exact_side(Vec2 a, Vec2 b, Vec2 p) {
    ExactSum sum;  // the products with a twice cancel: six remain
    sum.add_product(b.x, p.y, 1.0);
    sum.add_product(b.x, a.y, -1.0);
    sum.add_product(a.x, p.y, -1.0);
    sum.add_product(p.x, b.y, -1.0);
    sum.add_product(p.x, a.y, 1.0);
    sum.add_product(a.x, b.y, 1.0);
    return sum.sign();
}

}  // namespace ffseg::raster
