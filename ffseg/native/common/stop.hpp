// Why an evolution ends.
#pragma once

namespace ffseg {

enum class Stop {
    kRunning,
    kConverged,
    kMaxIterations,
    kMaxPatches,
    kBudget,
    kVanished,
    kBlocked,
    kStalled,
    kMaxPoints
};

// As results tell it.
inline const char* name_of(Stop stop) {
    constexpr const char* kNames[] = {"running",  "converged", "max_iterations", "max_patches", "budget",
                                      "vanished", "blocked",   "stalled",        "max_points"};
    return kNames[static_cast<int>(stop)];
}

}  // namespace ffseg
