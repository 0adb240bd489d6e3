// A boosted forest of small regression trees, evaluated for many pixels side by side.
#pragma once
#include <cstdint>
#include <vector>

#include "evidence/plane.hpp"

namespace ffseg::evidence {

// The leaves a tree may have: the leaves that a pixel can still reach are the bits of one number.
constexpr int kMaxLeaves = 32;

// Nodes as they are read, all trees one after the other. A child is a node by its index, or a leaf k as -1 - k.
struct ForestArrays {
    const std::int32_t* feature;
    const float* threshold;
    const std::int32_t *left, *right;
    std::size_t nodes;
    const std::int32_t* root;  // of each tree: a node, or a leaf, as children are named
    std::size_t trees;
    const float* value;  // of each leaf
    std::size_t leaves;
};

// A pixel whose feature is above the threshold cannot reach the leaves on the left; `keep` has the others.
struct ForestSplit {
    std::int32_t feature;
    float threshold;
    std::uint32_t keep;
};

// A forest that has been checked. Left is where the feature is at most the threshold.
class Forest {
public:
    // Throws std::invalid_argument where an index is out of range, a number is not finite, a node or leaf has not
    // exactly one place in the trees (so that there are no loops), or a tree has more leaves than `kMaxLeaves`.
    Forest(const ForestArrays& arrays, int features);

    int features() const { return features_; }
    std::size_t trees() const { return first_leaf_.size(); }

    // Sum of the leaves reached, in the order of the trees; `planes` are `features` planes of `count` values.
    void score(const float* planes, std::size_t count, float* out) const;

private:
    int features_;
    std::vector<ForestSplit> splits_;
    std::vector<std::size_t> first_split_, first_leaf_;
    std::vector<float> values_;  // of each tree from left to right
};

}  // namespace ffseg::evidence
