#include "baselines/snake/cyclic.hpp"

#include <cmath>

namespace ffseg::snake {

// The factors are what Cholesky's recursion on the endless band settles at.
CyclicSystem::CyclicSystem(double tension, double rigidity) {
    const double diagonal = 1.0 + 2.0 * tension + 6.0 * rigidity, beside = -tension - 4.0 * rigidity;
    constexpr int kMaxRows = 100000;  // reached by no weights up to 1000, where it takes about a thousand rows
    double before = diagonal;
    scale_ = diagonal;
    for (int row = 0; row < kMaxRows; ++row) {
        const double far = rigidity / before, near = (beside - rigidity * near_) / scale_;
        const double pivot = diagonal - near * near * scale_ - far * far * before;
        const bool settled = pivot == scale_ && near == near_ && far == far_;
        before = scale_;
        scale_ = pivot;
        near_ = near;
        far_ = far;
        if (settled) break;
    }
    constexpr double kForgotten = 1e-18;  // of a start: below half a unit in the last place of what it is added to
    double last = 1.0, now = 1.0;
    while (std::abs(last) + std::abs(now) > kForgotten && warm_ < kMaxRows) {
        const double next = -near_ * now - far_ * last;
        last = now;
        now = next;
        ++warm_;
    }
}

void CyclicSystem::solve(std::vector<Vec2>& v) {
    const std::size_t n = v.size();
    forward_.resize(n);
    Vec2 one, two;  // the last two values of a recursion
    const auto run = [&](Vec2 right) {
        const Vec2 value = right - near_ * one - far_ * two;
        two = one;
        one = value;
        return value;
    };
    for (std::size_t k = 0, i = (n - warm_ % n) % n; k < warm_; ++k, i = i + 1 < n ? i + 1 : 0) run(v[i]);
    for (std::size_t i = 0; i < n; ++i) forward_[i] = (1.0 / scale_) * run(v[i]);
    one = two = {};
    for (std::size_t k = 0, i = (warm_ + n - 1) % n; k < warm_; ++k, i = i > 0 ? i - 1 : n - 1) run(forward_[i]);
    for (std::size_t i = n; i-- > 0;) v[i] = run(forward_[i]);
}

}  // namespace ffseg::snake
