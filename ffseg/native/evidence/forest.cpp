#include "evidence/forest.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "common/lanes.hpp"

#if defined(FFSEG_GNU) && !defined(__clang__) && defined(__x86_64__)
#include <immintrin.h>
#define FFSEG_WIDER __attribute__((target("avx2")))
#define FFSEG_WIDEST __attribute__((target("avx512f,avx512cd")))
#endif

namespace ffseg::evidence {
namespace {

// Pixels worked on side by side; their features stay in the nearest cache.
constexpr int kBlock = 128;

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
            if (leaves_.size() > kMaxLeaves) refuse("a tree has more than 32 leaves");
            return;
        }
        const std::size_t node = static_cast<std::size_t>(child);
        if (node >= arrays_.nodes || seen_nodes_[node]) refuse("a node is absent or has two places");
        seen_nodes_[node] = true;
        if (++depth_ >= kMaxLeaves) refuse("a tree has more than 32 leaves");
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
#if defined(FFSEG_GNU)
struct Narrow {
    using Floats = float __attribute__((vector_size(16)));
    using Leaves = std::int32_t __attribute__((vector_size(16)));
};
struct Wide {
    using Floats = float __attribute__((vector_size(32)));
    using Leaves = std::int32_t __attribute__((vector_size(32)));
};

template <class Registers>
FFSEG_PART inline void rule_out(const ForestSplit* splits, std::size_t count, const float* block,
                                std::uint32_t* reachable) {
    using Floats = typename Registers::Floats;
    using Leaves = typename Registers::Leaves;
    constexpr int kLanes = sizeof(Floats) / sizeof(float), kTogether = 4;
    static_assert(kBlock % (kLanes * kTogether) == 0);
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
struct Narrow {};

template <class>
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
#if defined(FFSEG_GNU)
    return __builtin_ctz(number);
#else
    int bit = 0;
    while ((number >> bit & 1U) == 0) ++bit;
    return bit;
#endif
}

// Adds the leaf that each pixel reaches in a tree to its sum.
void add_tree(const ForestSplit* splits, std::size_t count, const float* leaves, const float* block, float* sums) {
    std::uint32_t reachable[kBlock];
    rule_out<Narrow>(splits, count, block, reachable);
    for (int i = 0; i < kBlock; ++i) sums[i] += leaves[lowest_bit(reachable[i])];
}

using AddTree = decltype(&add_tree);

#if defined(FFSEG_WIDEST)
FFSEG_WIDER
void add_tree_wider(const ForestSplit* splits, std::size_t count, const float* leaves, const float* block,
                    float* sums) {
    std::uint32_t reachable[kBlock];
    rule_out<Wide>(splits, count, block, reachable);
    for (int i = 0; i < kBlock; ++i) sums[i] += leaves[lowest_bit(reachable[i])];
}

// The same where sixteen pixels are compared at once and 32 leaves fit into two registers.
FFSEG_WIDEST
void add_tree_widest(const ForestSplit* splits, std::size_t count, const float* leaves, const float* block,
                     float* sums) {
    constexpr int kWide = 16, kGroups = kBlock / kWide;
    const __m512i none = _mm512_setzero_si512(), whole = _mm512_set1_epi32(-1);
    __m512i left[kGroups];
    for (__m512i& one : left) one = whole;
    for (std::size_t s = 0; s < count; ++s) {
        const float* values = block + static_cast<std::size_t>(splits[s].feature) * kBlock;
        const __m512 threshold = _mm512_set1_ps(splits[s].threshold);
        const __m512i keep = _mm512_set1_epi32(static_cast<int>(splits[s].keep));
        for (int k = 0; k < kGroups; ++k) {
            const __mmask16 above = _mm512_cmp_ps_mask(_mm512_loadu_ps(values + k * kWide), threshold, _CMP_NLE_UQ);
            left[k] = _mm512_mask_and_epi32(left[k], above, left[k], keep);
        }
    }
    const __m512 first = _mm512_loadu_ps(leaves), second = _mm512_loadu_ps(leaves + kWide);
    for (int k = 0; k < kGroups; ++k) {
        const __m512i lowest = _mm512_and_si512(left[k], _mm512_sub_epi32(none, left[k]));
        const __m512i place = _mm512_xor_si512(_mm512_lzcnt_epi32(lowest), whole);  // its last five bits: 31 - zeros
        const __m512 leaf = _mm512_permutex2var_ps(first, place, second);
        _mm512_storeu_ps(sums + k * kWide, _mm512_add_ps(_mm512_loadu_ps(sums + k * kWide), leaf));
    }
}

AddTree fastest() {
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd")) return add_tree_widest;
    return __builtin_cpu_supports("avx2") ? add_tree_wider : add_tree;
}
#else
AddTree fastest() { return add_tree; }
#endif

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
    values_.resize(values_.size() + kMaxLeaves);  // so that as many can be read from any tree's first on
    const bool all_nodes = std::find(seen_nodes.begin(), seen_nodes.end(), false) == seen_nodes.end();
    const bool all_leaves = std::find(seen_leaves.begin(), seen_leaves.end(), false) == seen_leaves.end();
    if (!all_nodes || !all_leaves) refuse("a node or a leaf belongs to no tree");
}

void Forest::score(const float* planes, std::size_t count, float* out) const {
    const AddTree add = fastest();
    std::vector<float> block(static_cast<std::size_t>(features_) * kBlock);
    for (std::size_t start = 0; start < count; start += kBlock) {
        const std::size_t pixels = std::min<std::size_t>(kBlock, count - start);
        for (std::size_t f = 0; f < static_cast<std::size_t>(features_); ++f) {
            const float* from = planes + f * count + start;
            std::copy(from, from + pixels, block.begin() + static_cast<std::ptrdiff_t>(f * kBlock));
            // the next block is fetched while this one is worked on
            for (std::size_t i = kBlock; i < std::min<std::size_t>(2 * kBlock, count - start); i += 16)
                FFSEG_PREFETCH(from + i);
        }
        float sums[kBlock] = {};
        for (std::size_t tree = 0; tree < trees(); ++tree) {
            const std::size_t splits = first_split_[tree + 1] - first_split_[tree];
            add(splits_.data() + first_split_[tree], splits, values_.data() + first_leaf_[tree], block.data(), sums);
        }
        std::copy(sums, sums + pixels, out + start);
    }
}

}  // namespace ffseg::evidence
