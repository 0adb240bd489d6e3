// What is fuzzed: one function a part of the core. Each keeps to what the part's binding checks before it calls the
// part, and goes to the limits of that.
#pragma once
#include "draw.hpp"

namespace fuzz {

void evolve(Random& random);        // freeform
void rasterize(Random& random);     // raster
void edges(Random& random);         // edges
void march(Random& random);         // baselines/marching
void level_set(Random& random);     // baselines/levelset
void outlines(Random& random);      // baselines/levelset
void snake(Random& random);         // baselines/snake
void cyclic(Random& random);        // baselines/snake
void nearest(Random& random);       // baselines/measures
void scores(Random& random);        // pairs
void alignment(Random& random);     // pairs
void interest(Random& random);      // pairs
void features(Random& random);      // evidence
void ways(Random& random);          // evidence
void forest(Random& random);        // evidence
void path_text(Random& random);     // text

}  // namespace fuzz
