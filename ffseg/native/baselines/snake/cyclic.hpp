// Kass's internal energy as a linear system: a cyclic pentadiagonal matrix solved in linear time.
#pragma once
#include <cstddef>
#include <vector>

#include "common/vec.hpp"

namespace ffseg::snake {

// I + A of a closed chain of points: A v_i = -tension (v_{i-1} - 2 v_i + v_{i+1})
//   + rigidity (v_{i-2} - 4 v_{i-1} + 6 v_i - 4 v_{i+1} + v_{i+2}). Every row is the same, so the matrix is a product
// scale * L * L^T with L x_i = x_i + near x_{i-1} + far x_{i-2}: two recursions round the ring, whose start is
// forgotten after `warm_` points to the last bit.
class CyclicSystem {
public:
    CyclicSystem(double tension, double rigidity);

    // Replaces the right-hand sides (x and y at once) by the solutions; at least 5 points.
    void solve(std::vector<Vec2>& v);

private:
    double scale_ = 1.0, near_ = 0.0, far_ = 0.0;
    std::size_t warm_ = 0;
    std::vector<Vec2> forward_;
};

}  // namespace ffseg::snake
