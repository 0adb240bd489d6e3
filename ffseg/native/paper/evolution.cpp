#include "paper/evolution.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace ffseg::paper {
namespace {

constexpr double kScale = 32.0;              // units of the stored gradient per grey level and pixel
constexpr double kSteady = 0.1;              // px; a sample that moves less has reached its steady state
constexpr std::size_t kShareMoving = 100;    // "almost all": at most one sample in so many still moves
constexpr std::size_t kMaxPatches = 20000;  // what crosses itself everywhere grows without end

// How far the sample moves along its unit normal.
double speed(const Field& field, const Force& force, Vec2 at, Vec2 normal) {
    const double gradient = field.gradient(at);
    if (field.homogeneous(at)) return force.balloon / (1.0 + std::pow(gradient, force.exponent));
    const double slope = 0.5 * (field.gradient(at + normal) - field.gradient(at - normal));
    return gradient > 0 ? std::clamp(force.sigma * force.sigma * slope / gradient, -1.0, 1.0) : 0.0;
}

// Displacement of a sample with this (not unit) tangent; the region lies to the right of it on the screen.
Vec2 displacement(const Field& field, const Force& force, Vec2 at, Vec2 tangent) {
    const Vec2 along = unit(tangent), normal{along.y, -along.x};
    const Vec2 by = speed(field, force, at, normal) * normal;
    return field.allowed(at + by) ? by : Vec2{};
}

}  // namespace

Field::Field(const std::uint16_t* gradient, const std::uint8_t* edges, const std::uint8_t* domain, int height,
             int width)
    : height_(height), width_(width), near_edge_(static_cast<std::size_t>(height) * static_cast<std::size_t>(width)) {
    for (std::size_t at = 0; at < near_edge_.size(); ++at) gradient_.push_back(gradient[at] / kScale);
    if (domain != nullptr) domain_.assign(domain, domain + near_edge_.size());
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            if (edges[pixel(x, y)] == 0) continue;
            for (int v = std::max(y - 1, 0); v <= std::min(y + 1, height - 1); ++v) {
                for (int u = std::max(x - 1, 0); u <= std::min(x + 1, width - 1); ++u) near_edge_[pixel(u, v)] = 1;
            }
        }
    }
}

std::size_t Field::pixel(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
}

double Field::gradient(Vec2 p) const {
    const double x = std::clamp(p.x, 0.0, width_ - 1.0), y = std::clamp(p.y, 0.0, height_ - 1.0);
    const int left = static_cast<int>(x), top = static_cast<int>(y);
    const int right = std::min(left + 1, width_ - 1), bottom = std::min(top + 1, height_ - 1);
    const double u = x - left, v = y - top;
    const double above = (1.0 - u) * gradient_[pixel(left, top)] + u * gradient_[pixel(right, top)];
    const double below = (1.0 - u) * gradient_[pixel(left, bottom)] + u * gradient_[pixel(right, bottom)];
    return (1.0 - v) * above + v * below;
}

bool Field::homogeneous(Vec2 p) const {
    return allowed(p) && near_edge_[pixel(static_cast<int>(p.x + 0.5), static_cast<int>(p.y + 0.5))] == 0;
}

bool Field::allowed(Vec2 p) const {
    if (!(p.x >= 0 && p.y >= 0 && p.x <= width_ - 1.0 && p.y <= height_ - 1.0)) return false;
    return domain_.empty() || domain_[pixel(static_cast<int>(p.x + 0.5), static_cast<int>(p.y + 0.5))] != 0;
}

Moved move(Contour& contour, const Field& field, const Force& force) {
    const Basis& basis = contour.basis;
    const int degree = basis.degree();
    Moved result{0, 0};
    for (Component& component : contour.components) {
        const std::size_t count = component.size();
        std::vector<Patch> by(count);  // displacements of the samples of each patch
        for (std::size_t i = 0; i < count; ++i) {
            const Patch &patch = component[i], &before = component[(i + count - 1) % count];
            for (int k = 0; k < degree; ++k) {
                const double t = static_cast<double>(k) / degree;
                Vec2 tangent = basis.derivative(patch, t);
                // Two patches meet at a joint: the mean of both normals keeps the contour closed.
                if (k == 0) tangent = unit(tangent) + unit(basis.derivative(before, 1.0));
                by[i][k] = displacement(field, force, basis.evaluate(patch, t), tangent);
                result.moved += norm2(by[i][k]) >= kSteady * kSteady;
                ++result.samples;
            }
        }
        for (std::size_t i = 0; i < count; ++i) {
            by[i][degree] = by[(i + 1) % count][0];
            const Patch delta = basis.interpolate(by[i]);
            for (int k = 0; k <= degree; ++k) component[i][k] += delta[k];
        }
    }
    return result;
}

Evolution::Evolution(Contour contour, Field field, Force force, Limits limits)
    : contour_(std::move(contour)), field_(std::move(field)), force_(force), limits_(limits) {}

Moved Evolution::step() {
    ++contour_.counts.iterations;
    contour_.counts.moved += contour_.num_patches();
    if (limits_.refine) {
        split(contour_, limits_.split_threshold);
        prune(contour_, limits_.split_threshold);
    }
    if (limits_.topology) flip(contour_);
    return move(contour_, field_, force_);
}

bool Evolution::advance(int iterations) {
    for (int done = 0; done < iterations && stop_ == Stop::kRunning; ++done) {
        if (contour_.counts.iterations >= limits_.max_iterations) {
            stop_ = Stop::kMaxIterations;
            break;
        }
        const Moved result = step();
        if (result.moved * kShareMoving <= result.samples) {
            stop_ = Stop::kConverged;
        } else if (contour_.num_patches() > kMaxPatches) {
            stop_ = Stop::kMaxPatches;
        } else if (contour_.is_spent()) {
            stop_ = Stop::kBudget;
        }
    }
    return stop_ == Stop::kRunning;
}

}  // namespace ffseg::paper
