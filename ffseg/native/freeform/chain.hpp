// The evolving contour: its state and the steps of one iteration, defined in move.hpp, refine.hpp, filter.hpp, flip.hpp
// (with components.hpp) and rest.hpp.
#pragma once
#include <cstdint>
#include <limits>
#include <unordered_set>
#include <utility>
#include <vector>

#include "freeform/evolution.hpp"
#include "freeform/pool.hpp"
#include "freeform/settling/settle.hpp"
#include "freeform/topology/strips.hpp"

namespace ffseg::freeform {

using ground::Field;
using settling::patch_of;
using settling::Samples;
using topology::Strip;

// A step is at most this part of the split threshold: where patches are shorter than a step, fronts pass over each other
// before they are seen to cross.
constexpr double kLongestStep = 0.5;
// Marching along a normal looks at the edge map every half pixel.
constexpr double kMarchStep = 0.5;
// Near edges a sample moves at most this far in one iteration: the edge band is three pixels wide, so neither the
// sample nor the stretch between two samples can pass it unseen.
constexpr double kCautiousStep = 2.0;
// Discs round two samples whose radii sum to this many times the distance between them hold the curve in between: two
// equal ones reach 0.41 of the distance to the side of its middle.
constexpr double kBulge = 1.3;
// The curve between samples is looked at every so many pixels: less than the thickness of a 4-connected chain; off the
// band round edges, less than that of the band, which the curve between two places may cross aslant.
constexpr float kLookEvery = 0.7f, kLookAfar = 1.75f;
// A sample that moved less than half a march step is steady.
constexpr double kSteady = 0.25;
// A resting stretch that could still advance this far between its samples is split instead.
constexpr double kUncovered = 2.0;
// A sample put back with more room ahead of it than this is moved on with more samples beside it.
constexpr double kHeldBack = 1.0;
// Before the contour counts as converged, places so many pixels apart are looked at for this: a gap that is open lets two
// by two pixels through.
constexpr double kCloseLook = 1.0;
// Where the front squeezes through a passage of a few pixels its samples lie no farther apart, or it turns by more than the
// angle with this cosine (45 degrees).
constexpr double kTipChord = 4.0, kTipTurn = 0.7;
// Pixels across an edge with the band on its two sides.
constexpr int kBandWidth = 3;
// Patches are not split below this distance between samples.
constexpr double kMinSpacing = 0.5;
// Patches shorter than this per sample are pruned.
constexpr double kPruneSpacing = 0.35;
// Away from edges patches shorter than this part of the split threshold are pruned.
constexpr double kPruneRatio = 0.2;
// A patch whose longest distance between samples is this many times the shortest is laid out evenly.
constexpr double kUneven = 3.0;
// So few moving patches are compared with all others instead of sorting.
constexpr std::size_t kFewActive = 16;
// Patches to a strip of the filter, and how low strips may get, in pixels: most patches reach into one.
constexpr std::size_t kStripPatches = 256;
constexpr std::size_t kStripHeight = 64;
// More new patches than this are sorted among themselves before they join the others.
constexpr std::size_t kFewNew = 16;
// Components enclosing less cannot hold the band of one edge pixel (3 x 3) and are dropped.
constexpr double kVoidArea = 4.0;
// The front may fold over itself at its corners, and cut off a negative loop that is no hole; these enclose less.
constexpr double kFoldArea = 64.0;
// A loop with more patches than this many times those of the one cut off from it is not walked over.
constexpr int kLongWalk = 16;
// Rounds of crossing tests in one iteration; what is left waits for the next.
constexpr int kFlipRounds = 6;
// Looking at the boxes of so many patches costs as much as walking over one.
constexpr std::size_t kBoxesToAPatch = 8;
// Patches walked over and pairs looked at in one iteration, to a patch; crossings beyond wait for the next one. Looking
// whether a flip cuts an edge counts as so many, to each degree.
constexpr std::size_t kExchange = 16;
constexpr std::size_t kMostWalked = 64;
// Patches near edges are halved down to this length, at most this often, before they are flipped, so that the flip
// cuts no edge.
constexpr double kFlipLength = 4.0;
constexpr int kFlipDepth = 4;
// Patches there may be beside one for every 16 pixels: more only come from a contour that runs over itself for ever.
constexpr int kMostPatches = 1000;

template <int D>
class Chain final : public Evolution {
public:
    Chain(const ContourSet& starts, const std::uint8_t* edges, const std::uint8_t* domain, int height, int width,
          const EvolutionOptions& options);

    bool advance(int iterations) override;
    void settle(const GradientView& gradient) override;
    ContourSet contours() const override;
    const EvolutionCounts& counts() const override { return counts_; }
    StopReason stop_reason() const override { return reason_; }

private:
    using Points = std::array<Vec2, D + 1>;
    static constexpr std::uint8_t kAllSteady = static_cast<std::uint8_t>((1u << D) - 1u);

    // evolution.cpp
    void add_contour(const Vec2* points, std::size_t count);
    bool step();
    void wake(int i);
    void release(int i);
    void forget_freed();
    std::vector<int> loops() const;
    std::vector<std::vector<Vec2>> sampled() const;
    double length(int i) const { return chords(i).total; }
    bool splittable(int i) const { return length(i) > 2 * D * kMinSpacing; }
    int split(int i);
    void keep_inside(int i);

    // move.hpp
    void move();
    struct Motion {
        Points points;
        std::array<Vec2, D> tangent;
        std::array<double, D> chord;
    };
    void measure(int i, Motion& motion);
    void move_patch(int i, const Motion& motion);
    double reach(Vec2 from, Vec2 normal, double wanted, double known) const;
    void guard();
    void reward_progress();
    bool guard_patch(int i);
    template <bool kMayOscillate>
    int first_hit(int i) const;
    int num_hits(int i) const;
    template <bool kMayOscillate>
    bool interval_hits(const Points& points, int k, double free) const;
    bool meets_edge(int i) const { return first_hit<true>(i) >= 0; }  // of a curve just made
    bool put_back(int i, int k);

    // refine.hpp
    void refine();
    bool too_long(int i) const;
    bool remove(int i);
    bool straighten(int i);
    bool folded(int i) const;
    struct Chords {
        double shortest, longest, total;
    };
    Chords chords(int i) const;
    void even_out(int i, const Chords& chords);
    bool swings(int i, double size) const;
    void calm(int i);
    bool passed_itself(int i) const;

    // rest.hpp
    void rest();
    template <bool kClosely>
    bool uncovered(int i) const;
    bool held_back(int i) const;
    bool wake_open();
    bool all_held() const;
    bool slide(int i);
    template <bool kClosely>
    bool open_ahead(const Points& points, int k) const;

    // filter.hpp, flip.hpp
    void flip_crossings();
    bool flip_round(bool only_touched);
    bool sweep(bool only_touched);
    void sort_patches();
    bool try_pair(int i, int j, bool only_touched);
    bool spent() const { return walked_ > most_walked_; }
    bool polygons_cross(int i, int j) const;
    bool flip(int i, int j, int depth);
    bool flip_finer(int i, int j, int depth);
    static Points joined_at(const Points& p, int a, const Points& q, int b, Vec2 at);
    bool swap_halves(int i, int j, Points& first, Points& second) const;
    static bool join_at_crossing(const Points& p, const Points& q, Points& first, Points& second);
    bool exchange(int i, int j);
    int turning_inwards(int i, int j) const;
    bool runs_one_way(int i, int j) const;
    void flip_adjacent(int i);

    // components.hpp
    template <typename Visit>
    void each_in_loop(int loop, Visit visit) const;
    void classify(int i, int j, int inner, bool simple);
    bool loop_encloses_solid(int i) const;
    bool nested(int loop);
    void drop(int i);
    void drop_nested();
    double loop_area(int i, int most = std::numeric_limits<int>::max()) const;
    double patch_area(int i, Vec2 origin) const;
    bool loop_contains(int loop, Vec2 p) const;

    EvolutionOptions options_;
    Field field_;
    Pool<D> pool_;
    std::vector<int> active_, freed_, sorted_, queue_;
    std::vector<Motion> motion_;
    std::vector<std::pair<int, int>> undecided_;  // flips whose components cannot be classified yet
    std::size_t num_sorted_ = 0;  // of sorted_ were in order after the last sweep
    std::vector<std::pair<double, int>> keys_;
    std::vector<Strip> strips_;
    std::vector<std::uint8_t> moving_, own_;
    std::unordered_set<std::size_t> retried_;  // pixels
    int num_stray_ = 0;  // patches at rest with a sample in the open, when last looked at closely
    std::vector<std::uint8_t> reached_;  // tiles in which a sample has been
    std::vector<std::vector<Vec2>> settled_;  // the samples of each component once it has settled
    EvolutionCounts counts_;
    StopReason reason_ = StopReason::kRunning;
    bool outside_filled_ = false;
    mutable std::size_t walked_ = 0;  // patches and pairs in this iteration
    std::size_t most_walked_ = 0;
    bool unresolved_ = false;  // polygons crossed in this iteration that no flip has parted
    int most_patches_;
};

}  // namespace ffseg::freeform
