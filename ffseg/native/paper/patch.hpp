// One Bezier patch by its control points: evaluation (Algorithm 1), interpolation (Eq. 4 to 6), split (Algorithm 2).
#pragma once
#include <array>
#include <utility>

#include "common/vec.hpp"

namespace ffseg::paper {

constexpr int kMaxPatchDegree = 6;
using Patch = std::array<Vec2, kMaxPatchDegree + 1>;  // P_0 .. P_d, or M_0 .. M_d; what lies beyond d is not used

// What one degree needs: V^-1 is computed once (Lemma 1).
class Basis {
public:
    explicit Basis(int degree);

    int degree() const { return degree_; }
    Vec2 evaluate(const Patch& control, double t) const;    // Algorithm 1
    Vec2 derivative(const Patch& control, double t) const;  // with respect to t
    Patch interpolate(const Patch& samples) const;          // Eq. 6: (d + 1)^2 products a coordinate
    std::pair<Patch, Patch> halves(const Patch& control) const;
    Box box(const Patch& control) const;
    double spread2(const Patch& control) const;  // square of the largest distance between two control points
    bool cross(const Patch& p, const Patch& q, int* crossings = nullptr) const;  // do control polygons, properly?

private:
    int degree_;
    std::array<std::array<double, kMaxPatchDegree + 1>, kMaxPatchDegree + 1> inverse_{};
};

}  // namespace ffseg::paper
