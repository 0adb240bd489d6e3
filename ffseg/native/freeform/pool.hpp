// A pool of patches in closed chains: split, remove and flip are O(1) and move no array.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "common/vec.hpp"
#include "freeform/basis.hpp"

namespace ffseg::freeform {

// Splits, straightenings and re-samplings that a patch held by edges may undergo before one of its samples reaches
// space not visited before; then it rests.
constexpr std::uint8_t kSplitBudget = 24;
// Degree reductions of a patch that oscillates near edges, before it is split or held.
constexpr std::uint8_t kMaxReductions = 5;

template <int D>
struct Patch {
    std::array<Vec2, D> m;            // on-curve samples M_0 .. M_{D-1}; M_D is the next patch's M_0
    std::array<Vec2, D> before;       // the samples before this iteration's move
    std::array<Vec2, D + 1> control;  // control points V^-1 M, valid after refresh()
    Vec2 end_tangent;        // unit tangent at the end joint before this iteration's move
    double last_chord = 0;   // distance between the last two samples before this iteration's move
    int next = -1, prev = -1;
    std::uint8_t budget = kSplitBudget;  // of repairs left, see kSplitBudget
    std::uint8_t reductions = 0;             // of degree, near edges
    std::uint8_t steady = 0;    // bit k: sample k did not move in this iteration
    std::uint8_t reverted = 0;  // bit k: sample k was put back because the curve met an edge
    bool examined = false;      // at rest, and examined since
    bool starved = false;       // could advance between samples, but has no repairs left
    bool alive = false, active = false, near_edges = false, wants_split = false, touched = false;
};

// Bits of all samples of a patch.
template <int D>
constexpr std::uint8_t kAllSteady = static_cast<std::uint8_t>((1u << D) - 1u);

// Patches by the image rows of their boxes, for queries of many points. Entries may be repeated or outdated: queries
// test the box. The index follows refreshed patches only while it is in use.
class Rows {
public:
    void reset(int height) {
        rows_.resize(static_cast<std::size_t>(height / kHeight + 1));
        for (auto& row : rows_) row.clear();
    }
    void add(int i, const Box& box) {
        for (std::size_t at = row_of(box.y0), last = row_of(box.y1); at <= last; ++at) rows_[at].push_back(i);
    }
    const std::vector<int>& at(double y) const { return rows_[row_of(y)]; }

    bool used = false;

private:
    static constexpr int kHeight = 16;  // pixels; most patches lie in one
    std::size_t row_of(double y) const {
        return static_cast<std::size_t>(std::clamp(y / kHeight, 0.0, static_cast<double>(rows_.size() - 1)));
    }
    std::vector<std::vector<int>> rows_;
};

template <int D>
class Pool {
public:
    Patch<D>& operator[](int i) { return patches_[static_cast<std::size_t>(i)]; }
    const Patch<D>& operator[](int i) const { return patches_[static_cast<std::size_t>(i)]; }
    int size() const { return static_cast<int>(patches_.size()); }
    int num_alive() const { return alive_; }

    void reserve(std::size_t patches) {
        patches_.reserve(patches);
        boxes_.reserve(patches);
    }
    int acquire() {
        int at = 0;
        if (free_.empty()) {
            at = size();
            patches_.emplace_back();
            boxes_.emplace_back();
        } else {
            at = free_.back();
            free_.pop_back();
            (*this)[at] = Patch<D>{};
        }
        (*this)[at].alive = true;
        ++alive_;
        return at;
    }
    void release(int i) {
        (*this)[i].alive = (*this)[i].active = false;
        free_.push_back(i);
        --alive_;
    }
    const Box& box(int i) const { return boxes_[static_cast<std::size_t>(i)]; }
    void link(int a, int b) {
        (*this)[a].next = b;
        (*this)[b].prev = a;
    }
    Vec2 end(int i) const { return (*this)[(*this)[i].next].m[0]; }
    Points<D> samples(int i) const {
        const Patch<D>& patch = (*this)[i];
        Points<D> points;
        for (int k = 0; k < D; ++k) points[k] = patch.m[k];
        points[D] = end(i);
        return points;
    }
    // Gives patch i the curve with these control points; the joint it starts with moves along, the end joint does not.
    void set_control(int i, const Points<D>& control) {
        Patch<D>& patch = (*this)[i];
        patch.m[0] = control[0];
        for (int k = 1; k < D; ++k) patch.m[k] = apply<D>(kBasis<D>.vandermonde[k], control);
        patch.before = patch.m;
    }
    // Control points (Eq. 6) and their box.
    void refresh(int i) {
        Patch<D>& patch = (*this)[i];
        const Points<D> points = samples(i);
        patch.control[0] = points[0];
        patch.control[D] = points[D];
        for (int k = 1; k < D; ++k) patch.control[k] = apply<D>(kBasis<D>.inverse[k], points);
        Box box;
        for (const Vec2& p : patch.control) box.add(p);
        boxes_[static_cast<std::size_t>(i)] = box;
        if (rows.used) rows.add(i, box);
    }
    // Algorithm 2: the same curve as two patches; the new one follows i. Returns it.
    int split(int i) {
        const Points<D> points = samples(i);
        const int fresh = acquire(), after = (*this)[i].next;
        Patch<D>&first = (*this)[i], &second = (*this)[fresh];
        for (int k = 0; k < D; ++k) {
            first.m[k] = apply<D>(kBasis<D>.halves[k], points);
            second.m[k] = apply<D>(kBasis<D>.halves[D + k], points);
        }
        first.m[0] = points[0];
        first.before = first.m;
        second.before = second.m;
        second.active = first.active;
        second.budget = first.budget;
        second.near_edges = first.near_edges;
        link(i, fresh);
        link(fresh, after);
        refresh(i);
        refresh(fresh);
        return fresh;
    }

    Rows rows;

private:
    std::vector<Patch<D>> patches_;
    std::vector<Box> boxes_;  // of the control points, beside the patches: the filter reads nothing else
    std::vector<int> free_;
    int alive_ = 0;
};

}  // namespace ffseg::freeform
