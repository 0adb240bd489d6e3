#include "paper/patch.hpp"

#include <cmath>

namespace ffseg::paper {
namespace {

double bernstein(int degree, int i, double t) {  // Eq. 2
    double value = 1.0;
    for (int n = 0; n < i; ++n) value = value * (degree - n) / (n + 1) * t;
    for (int n = i; n < degree; ++n) value *= 1.0 - t;
    return value;
}

}  // namespace

Basis::Basis(int degree) : degree_(degree) {
    std::array<std::array<double, kMaxPatchDegree + 1>, kMaxPatchDegree + 1> v{};  // Eq. 5
    for (int k = 0; k <= degree; ++k) {
        for (int i = 0; i <= degree; ++i) v[k][i] = bernstein(degree, i, static_cast<double>(k) / degree);
        inverse_[k][k] = 1.0;
    }
    for (int column = 0; column <= degree; ++column) {  // Gauss-Jordan with pivoting
        int pivot = column;
        for (int row = column + 1; row <= degree; ++row) {
            if (std::abs(v[row][column]) > std::abs(v[pivot][column])) pivot = row;
        }
        std::swap(v[column], v[pivot]);
        std::swap(inverse_[column], inverse_[pivot]);
        const double scale = v[column][column];
        for (int i = 0; i <= degree; ++i) {
            v[column][i] /= scale;
            inverse_[column][i] /= scale;
        }
        for (int row = 0; row <= degree; ++row) {
            const double factor = v[row][column];
            if (row == column) continue;
            for (int i = 0; i <= degree; ++i) {
                v[row][i] -= factor * v[column][i];
                inverse_[row][i] -= factor * inverse_[column][i];
            }
        }
    }
}

Vec2 Basis::evaluate(const Patch& control, double t) const {
    Patch left = control;
    for (int level = 1; level <= degree_; ++level) {
        for (int i = 0; i + level <= degree_; ++i) left[i] = (1.0 - t) * left[i] + t * left[i + 1];
    }
    return left[0];
}

Vec2 Basis::derivative(const Patch& control, double t) const {
    Patch left{};
    for (int i = 0; i < degree_; ++i) left[i] = static_cast<double>(degree_) * (control[i + 1] - control[i]);
    for (int level = 1; level < degree_; ++level) {
        for (int i = 0; i + level < degree_; ++i) left[i] = (1.0 - t) * left[i] + t * left[i + 1];
    }
    return left[0];
}

Patch Basis::interpolate(const Patch& samples) const {
    Patch control{};
    for (int i = 0; i <= degree_; ++i) {
        for (int k = 0; k <= degree_; ++k) control[i] += inverse_[i][k] * samples[k];
    }
    control[0] = samples[0];  // the ends are on the curve: joints stay closed to the last bit
    control[degree_] = samples[degree_];
    return control;
}

std::pair<Patch, Patch> Basis::halves(const Patch& control) const {
    Patch first{}, second{};
    for (int i = 0; i <= degree_; ++i) {
        first[i] = evaluate(control, i / (2.0 * degree_));
        second[i] = evaluate(control, (i + degree_) / (2.0 * degree_));
    }
    return {interpolate(first), interpolate(second)};
}

Box Basis::box(const Patch& control) const {
    Box found;
    for (int i = 0; i <= degree_; ++i) found.add(control[i]);
    return found;
}

double Basis::spread2(const Patch& control) const {
    double most = 0.0;
    for (int i = 0; i <= degree_; ++i) {
        for (int k = i + 1; k <= degree_; ++k) most = std::max(most, norm2(control[k] - control[i]));
    }
    return most;
}

bool Basis::cross(const Patch& p, const Patch& q, int* crossings) const {
    int found = 0;
    for (int a = 0; a < degree_; ++a) {
        for (int b = 0; b < degree_; ++b) found += segments_cross(p[a], p[a + 1], q[b], q[b + 1]);
    }
    if (crossings != nullptr) *crossings = found;
    return found > 0;
}

}  // namespace ffseg::paper
