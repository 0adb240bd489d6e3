// The evolving contour: the state of Algorithm 4, and its invariants between steps.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <unordered_set>
#include <utility>
#include <vector>

#include "freeform/evolution.hpp"
#include "freeform/field/field.hpp"
#include "freeform/pool.hpp"
#include "freeform/topology/strips.hpp"
#include "region/pressure.hpp"

namespace ffseg::freeform {

// Largest step as a fraction of the split threshold: with patches shorter than a step, fronts would pass over each
// other before their crossing is found.
constexpr double kMaxStep = 0.5;
// Pixels: patches are not split below this distance between samples.
constexpr double kMinSpacing = 0.5;
// Pixels: patches near edges with a smaller distance between samples are pruned.
constexpr double kPruneSpacing = 0.35;

// Memory is reserved for one patch per this many pixels of image height plus width, which large regions often need.
constexpr int kPixelsToAPatch = 4;

struct Chords {
    double shortest, longest, total;
};

// A patch before it moves: its samples, the tangents of the curve there and the distances between them.
template <int D>
struct Motion {
    Points<D> points;
    std::array<Vec2, D> tangent;
    std::array<double, D> chord;
};

// Where the contour has been: tiles visited by a sample, pixels from which a resting patch was woken.
struct Memory {
    std::vector<std::uint8_t> reached;
    std::unordered_set<std::size_t> retried;
    int num_stray = 0;  // resting patches with a sample in open space, at the last close test
};

// Budget of one iteration for topology, in patch visits and pair tests, and the work of all iterations so far.
struct Effort {
    mutable std::size_t visits = 0;
    std::size_t most = 0;
    std::size_t work = 0;  // patches moved or examined; kMaxVisits visits count as one
    std::size_t asked = 0;  // queries in one iteration whether a loop is nested
    bool unresolved = false;  // a crossing of this iteration that no flip has resolved
};

// Buffers reused in each iteration.
template <int D>
struct Buffers {
    std::vector<Motion<D>> motion;
    std::vector<int> queue;
    std::vector<std::pair<double, int>> keys;
    std::vector<topology::Strip> strips;
    std::vector<std::uint8_t> moving;
    std::vector<int> seen;  // the last query that visited a patch, or that its loop belongs to
    int question = 0;
};

// A free form (Definition 1): closed components of patches. Between two steps of an iteration
//  1. `next` leads from every living patch round its component back to it, and `prev` is the way back;
//  2. a component has two patches or more;
//  3. components run so that free space lies on the side of positive area: outer ones have positive area, holes
//  negative;
//  4. all samples lie in the image, and no curve enters an edge it was not made on;
//  5. `order` names every living patch once, its first `num_ordered` as the last sweep left them;
//  6. `active` names every active patch once; its other entries came to rest, or died, in this iteration;
//  7. dead patches are in `retired` until the iteration ends, and their slots are not used again before;
//  8. control points and box of a patch follow from its samples (Eq. 6) once it is refreshed; all are when crossings
//     are tested.
template <int D>
class Contour : public Pool<D> {
public:
    // The starts of an evolution; the edge and domain arrays are read here only.
    Contour(const ContourSet& starts, const std::uint8_t* edges, const std::uint8_t* domain, int height, int width,
            const EvolutionOptions& given)
        : options(given), field(edges, domain, height, width) {
        memory.reached.resize(field.num_tiles());
        this->reserve(static_cast<std::size_t>(height + width) / kPixelsToAPatch);
        options.balloon = std::min(options.balloon, kMaxStep * options.split_threshold);
        for (std::size_t c = 0; c + 1 < starts.offsets.size(); ++c) {
            add(starts.points.data() + starts.offsets[c], starts.offsets[c + 1] - starts.offsets[c]);
        }
    }

    // A component from its control points.
    void add(const Vec2* points, std::size_t count) {
        const int patches = static_cast<int>(count / D);
        std::vector<int> made;
        for (int i = 0; i < patches; ++i) made.push_back(this->acquire());
        for (int i = 0; i < patches; ++i) {
            Points<D> control;
            for (int k = 0; k <= D; ++k) control[k] = points[(static_cast<std::size_t>(i) * D + k) % count];
            this->link(made[i], made[(i + 1) % patches]);
            this->set_control(made[i], control);
            for (Vec2& sample : (*this)[made[i]].m) sample = field.clamp(sample);
            (*this)[made[i]].before = (*this)[made[i]].m;
        }
        for (int i : made) {
            this->refresh(i);
            (*this)[i].active = true;
            active.push_back(i);
            order.push_back(i);
        }
    }

    void wake(int i) {
        Patch<D>& patch = (*this)[i];
        if (patch.active || !patch.alive) return;
        patch.active = true;
        patch.examined = false;
        active.push_back(i);
    }

    // Its slot may be used again after the iteration.
    void retire(int i) {
        (*this)[i].alive = (*this)[i].active = false;
        retired.push_back(i);
    }

    // Slots of patches retired in this iteration are reused only now, when no list names them any more.
    void reclaim() {
        const auto dead = [this](int i) { return !(*this)[i].alive; };
        if (!retired.empty()) {
            const auto known = order.begin() + static_cast<std::ptrdiff_t>(num_ordered);
            num_ordered -= static_cast<std::size_t>(std::count_if(order.begin(), known, dead));
            order.erase(std::remove_if(order.begin(), order.end(), dead), order.end());
        }
        active.erase(std::remove_if(active.begin(), active.end(), [this](int i) { return !(*this)[i].active; }),
                     active.end());
        for (int i : retired) this->release(i);
        retired.clear();
    }

    // Algorithm 2 for patch i. Returns the new patch, which follows it.
    int split(int i) {
        const int fresh = Pool<D>::split(i);
        keep_inside(i);
        keep_inside(fresh);
        order.push_back(fresh);
        if ((*this)[fresh].active) active.push_back(fresh);
        ++counts.splits;
        return fresh;
    }

    // Between samples inside the image the curve may leave it; new samples of it are moved inside.
    void keep_inside(int i) {
        bool moved = false;
        for (Vec2& sample : (*this)[i].m) {
            const Vec2 inside = field.clamp(sample);
            moved = moved || inside.x != sample.x || inside.y != sample.y;
            sample = inside;
        }
        if (!moved) return;
        this->refresh(i);
        this->refresh((*this)[i].prev);
    }

    Chords chords(int i) const {
        const Points<D> points = this->samples(i);
        Chords found{std::numeric_limits<double>::infinity(), 0.0, 0.0};
        for (int k = 0; k < D; ++k) {
            const double chord = norm(points[k + 1] - points[k]);
            found.shortest = std::min(found.shortest, chord);
            found.longest = std::max(found.longest, chord);
            found.total += chord;
        }
        return found;
    }
    double length(int i) const { return chords(i).total; }
    bool splittable(int i) const { return length(i) > 2 * D * kMinSpacing; }

    // Calls visit(patch) for those of the component of patch i, in order from it.
    template <typename Visit>
    void each_in(int i, Visit visit) const {
        int at = i;
        do {
            const int next = (*this)[at].next;
            visit(at);
            at = next;
        } while (at != i);
    }

    // One patch of each component.
    std::vector<int> components() const {
        std::vector<int> firsts;
        std::vector<bool> seen(static_cast<std::size_t>(this->size()));
        for (int i = 0; i < this->size(); ++i) {
            if (!(*this)[i].alive || seen[static_cast<std::size_t>(i)]) continue;
            firsts.push_back(i);
            for (int at = i; !seen[static_cast<std::size_t>(at)]; at = (*this)[at].next) {
                seen[static_cast<std::size_t>(at)] = true;
            }
        }
        return firsts;
    }

    EvolutionOptions options;
    field::Field field;
    std::unique_ptr<region::Pressure> pressure;  // by colour, if its weight is positive
    EvolutionCounts counts;
    std::vector<int> active, order, retired;
    std::size_t num_ordered = 0;
    std::vector<std::pair<int, int>> undecided;  // flips whose components cannot be classified yet
    bool outside_filled = false;                 // contours close in from outside
    Memory memory;
    Effort effort;
    Buffers<D> buffers;
};

// Does the colour there stop the front (region.weight)?
template <int D>
bool colour_stops(const Contour<D>& contour, Vec2 p) {
    return contour.pressure != nullptr && contour.pressure->stops(p);
}

}  // namespace ffseg::freeform
