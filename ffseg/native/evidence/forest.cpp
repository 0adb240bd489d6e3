#include "evidence/forest.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "common/lanes.hpp"

namespace ffseg::evidence {
namespace {

// Pixels worked on side by side; their features stay in the nearest cache.
constexpr int kBlock = 64;

void refuse(const char* why) { throw std::invalid_argument(why); }

// Checks an array by array what can be checked without the shape of the trees.
void check_numbers(const ForestArrays& arrays, int features) {
    for (std::size_t i = 0; i < arrays.nodes; ++i) {
        if (arrays.feature[i] < 0 || arrays.feature[i] >= features)
            refuse("a node asks for a feature that there is not");
        if (!std::isfinite(arrays.threshold[i])) refuse("a threshold is not finite");
    }
    for (std::size_t i = 0; i < arrays.leaves; ++i) {
        if (!(std::abs(arrays.value[i]) <= 1e6F)) refuse("the value of a leaf is not finite or beyond 1e6");
    }
}

// Walks one tree from left to right.
class Walk {
public:
    Walk(const ForestArrays& arrays, std::vector<bool>& seen_nodes, std::vector<bool>& seen_leaves)
        : arrays_(arrays), seen_nodes_(seen_nodes), seen_leaves_(seen_leaves) {}

    // Calls `split(node, first, middle)` for each node, whose left leaves are those from `first` up to `middle`, and
    // returns the leaves in order.
    template <class OnSplit>
    std::vector<std::size_t> run(std::int32_t root, const OnSplit& split) {
        visit(root, split);
        return leaves_;
    }

private:
    template <class OnSplit>
    void visit(std::int32_t child, const OnSplit& split) {
        if (child < 0) {
            const std::size_t leaf = static_cast<std::size_t>(-1 - static_cast<std::int64_t>(child));
            if (leaf >= arrays_.leaves || seen_leaves_[leaf]) refuse("a leaf is absent or has two places");
            seen_leaves_[leaf] = true;
            leaves_.push_back(leaf);
            if (leaves_.size() > kMostLeaves) refuse("a tree has more than 32 leaves");
            return;
        }
        const std::size_t node = static_cast<std::size_t>(child);
        if (node >= arrays_.nodes || seen_nodes_[node]) refuse("a node is absent or has two places");
        seen_nodes_[node] = true;
        if (++depth_ >= kMostLeaves) refuse("a tree has more than 32 leaves");
        const std::size_t first = leaves_.size();
        visit(arrays_.left[node], split);
        split(node, first, leaves_.size());
        visit(arrays_.right[node], split);
        --depth_;
    }

    const ForestArrays& arrays_;
    std::vector<bool>&seen_nodes_, &seen_leaves_;
    std::vector<std::size_t> leaves_;
    int depth_ = 0;
};

// Bits from `first` up to `end`.
std::uint32_t bits(std::size_t first, std::size_t end) {
    return static_cast<std::uint32_t>((std::uint64_t{1} << end) - (std::uint64_t{1} << first));
}

// The leaves that pixels can reach in a tree: those that no split has ruled out. Some pixels are worked on from the
// first split to the last, so that their leaves stay in registers.
#if defined(__GNUC__)
using Floats = float __attribute__((vector_size(32)));
using Leaves = std::int32_t __attribute__((vector_size(32)));
constexpr int kLanes = 8, kTogether = 4;
static_assert(kBlock % (kLanes * kTogether) == 0);

FFSEG_CLONES
void rule_out(const ForestSplit* splits, std::size_t count, const float* block, std::uint32_t* reachable) {
    for (int first = 0; first < kBlock; first += kLanes * kTogether) {
        Leaves left[kTogether];
        for (Leaves& one : left) one = Leaves{} - 1;
        for (std::size_t s = 0; s < count; ++s) {
            const float* values = block + static_cast<std::size_t>(splits[s].feature) * kBlock + first;
            const Floats threshold = Floats{} + splits[s].threshold;
            const Leaves keep = Leaves{} + static_cast<std::int32_t>(splits[s].keep);
            for (int k = 0; k < kTogether; ++k) {
                Floats own;
                std::memcpy(&own, values + k * kLanes, sizeof own);
                left[k] &= (own <= threshold) | keep;
            }
        }
        std::memcpy(reachable + first, left, sizeof left);
    }
}
#else
void rule_out(const ForestSplit* splits, std::size_t count, const float* block, std::uint32_t* reachable) {
    std::fill(reachable, reachable + kBlock, ~std::uint32_t{0});
    for (std::size_t s = 0; s < count; ++s) {
        const float* values = block + static_cast<std::size_t>(splits[s].feature) * kBlock;
        for (int i = 0; i < kBlock; ++i) {
            reachable[i] &= values[i] <= splits[s].threshold ? ~std::uint32_t{0} : splits[s].keep;
        }
    }
}
#endif

int lowest_bit(std::uint32_t number) {
#if defined(__GNUC__)
    return __builtin_ctz(number);
#else
    int bit = 0;
    while ((number >> bit & 1U) == 0) ++bit;
    return bit;
#endif
}

}  // namespace

Forest::Forest(const ForestArrays& arrays, int features) : features_(features) {
    check_numbers(arrays, features);
    std::vector<bool> seen_nodes(arrays.nodes), seen_leaves(arrays.leaves);
    for (std::size_t tree = 0; tree < arrays.trees; ++tree) {
        first_split_.push_back(splits_.size());
        first_leaf_.push_back(values_.size());
        const auto split = [&](std::size_t node, std::size_t first, std::size_t middle) {
            splits_.push_back({arrays.feature[node], arrays.threshold[node], ~bits(first, middle)});
        };
        Walk walk(arrays, seen_nodes, seen_leaves);
        for (const std::size_t leaf : walk.run(arrays.root[tree], split)) values_.push_back(arrays.value[leaf]);
    }
    first_split_.push_back(splits_.size());
    const bool all_nodes = std::find(seen_nodes.begin(), seen_nodes.end(), false) == seen_nodes.end();
    const bool all_leaves = std::find(seen_leaves.begin(), seen_leaves.end(), false) == seen_leaves.end();
    if (!all_nodes || !all_leaves) refuse("a node or a leaf belongs to no tree");
}

void Forest::score(const float* planes, std::size_t count, float* out) const {
    std::vector<float> block(static_cast<std::size_t>(features_) * kBlock);
    for (std::size_t start = 0; start < count; start += kBlock) {
        const std::size_t pixels = std::min<std::size_t>(kBlock, count - start);
        for (std::size_t f = 0; f < static_cast<std::size_t>(features_); ++f) {
            const float* from = planes + f * count + start;
            std::copy(from, from + pixels, block.begin() + static_cast<std::ptrdiff_t>(f * kBlock));
        }
        float sums[kBlock] = {};
        for (std::size_t tree = 0; tree < trees(); ++tree) {
            std::uint32_t reachable[kBlock];
            const std::size_t splits = first_split_[tree + 1] - first_split_[tree];
            rule_out(splits_.data() + first_split_[tree], splits, block.data(), reachable);
            const float* leaves = values_.data() + first_leaf_[tree];
            for (int i = 0; i < kBlock; ++i) sums[i] += leaves[lowest_bit(reachable[i])];
        }
        std::copy(sums, sums + pixels, out + start);
    }
}

}  // namespace ffseg::evidence
