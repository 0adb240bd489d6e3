// The contour of the paper and what Algorithms 2 and 3 do to it, in the order they are printed.
#pragma once
#include <cstddef>
#include <utility>
#include <vector>

#include "paper/patch.hpp"

namespace ffseg::paper {

// Each patch begins where the one before it ends, the first where the last ends.
using Component = std::vector<Patch>;

struct Place {
    std::size_t component, patch;
};

// So many tests of two patches take the time of moving one.
constexpr std::size_t kTestsToAMove = 64;

// What was done, in the units of Lemmas 3 to 5.
struct Counts {
    int iterations = 0, splits = 0, prunes = 0, flips = 0, merges = 0, reversals = 0;
    std::size_t moved = 0;          // patches, in all iterations
    std::size_t comparisons = 0;    // of two boxes while sorting
    std::size_t box_tests = 0;      // of two boxes by the filter
    std::size_t polygon_tests = 0;  // of two control polygons

    std::size_t work() const { return moved + (comparisons + box_tests + polygon_tests) / kTestsToAMove; }
};

struct Contour {
    Basis basis;
    std::vector<Component> components;  // Gamma_out of each start: what Algorithm 4 goes on with
    std::vector<Component> inner;       // Gamma_inn: what flips have cut off, as it was then
    Counts counts;
    std::size_t budget = 0;  // of work: patches moved, and tests of two; 0: no limit

    bool is_spent() const { return budget > 0 && counts.work() > budget; }
    std::size_t num_patches() const;  // of what goes on
};

// Algorithm 2: each patch two of whose control points lie farther apart than the threshold becomes two.
void split(Contour& contour, double threshold);

// Footnote of Section 3.3: two adjacent patches become one that keeps every second of their control points. It does not
// say when: here, where both together fit into half of the threshold, so that what was split is not joined again.
void prune(Contour& contour, double threshold);

// The bounding-box filter: places of patches that are not adjacent and whose boxes meet, in the order of the sweep.
// Differs: boxes are compared along both axes; the printed test looks at y only where the sides along x agree.
std::vector<std::pair<Place, Place>> meeting(Contour& contour);

// Algorithm 3, corrected (the printed order of the second patch does not connect), until no two patches can be flipped
// or there were as many flips as patches, or the budget is spent.
void flip(Contour& contour);

// The same curve the other way round.
Component reversed(const Component& component, int degree);

}  // namespace ffseg::paper
