// Pixel features, ways from a start, levels and forests.
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "evidence/flood.hpp"
#include "evidence/forest.hpp"
#include "evidence/lab.hpp"
#include "evidence/level.hpp"
#include "evidence/relative.hpp"
#include "evidence/texture.hpp"
#include "targets.hpp"

namespace fuzz {
namespace {

namespace evidence = ffseg::evidence;

constexpr float kLargest = 1e6F;  // what the bindings let through

std::vector<float> draw_floats(Random& random, std::size_t count) {
    std::vector<float> values(count);
    const int kind = random.below(4);
    for (float& value : values) {
        const double ramp = random.between(0, 100), odd = random.pick({0.0, -0.0, 1e6, -1e6, 1e-40, 0.5});
        value = static_cast<float>(kind == 0 ? ramp : kind == 1 ? odd : kind == 2 ? random.between(-1e6, 1e6) : 1.0);
    }
    return values;
}

// Heights may be anything: what is no number counts as none.
void spoil(Random& random, std::vector<float>& values) {
    constexpr float kInfinite = std::numeric_limits<float>::infinity();
    for (int n = random.below(4); n > 0; --n) {
        const std::size_t at = static_cast<std::size_t>(random.below(static_cast<int>(values.size())));
        values[at] = random.pick({kInfinite, -kInfinite, std::nanf(""), 3e38F});
    }
}

}  // namespace

void features(Random& random) {
    const Size drawn = draw_size(random, 1, 4096);
    const int channels = random.pick({1, 3, 4}), factor = random.pick({1, 1, 2, 3, 7, 256});
    const std::vector<std::uint8_t> bytes = draw_bytes(random, drawn.count() * static_cast<std::size_t>(channels));
    const ffseg::Picture pixels{bytes.data(), drawn.height, drawn.width, channels};
    const ffseg::Size size = evidence::reduced(pixels, factor);
    std::vector<float> lab(3 * size.count());
    evidence::reduced_lab(pixels, factor, lab.data());
    expect(std::all_of(lab.begin(), lab.end(), [](float v) { return std::abs(v) < 150; }), "a colour out of range");
    if (random.once_in(4)) lab = draw_floats(random, lab.size());
    std::vector<float> out(evidence::kTexturePlanes * size.count());
    std::vector<float> small(evidence::halved(size).count()),
        large(pixels.height * static_cast<std::size_t>(pixels.width));
    evidence::thin(lab.data(), size, small.data());
    evidence::steepest(lab.data() + size.count(), size, small.data());
    evidence::enlarge(lab.data(), size, {{pixels.height, pixels.width}, factor, random.among(1, 3)}, large.data());
    evidence::texture(lab.data(), size, random.pick({0.01, 0.7, 6.0, 32.0}), out.data());
    const std::vector<std::uint8_t> inside = draw_marks(random, {size.height, size.width});
    evidence::relative_colour(lab.data(), inside.data(), size, random.pick({1e-6, 1.5}), {lab.data(), size.count()},
                              out.data());
    evidence::likelihood_ratio(lab.data(), inside.data(), size, out.data());
    expect(std::all_of(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(size.count()),
                       [](float v) { return std::abs(v) < 15; }),
           "a likelihood beyond what the shares allow");
}

void ways(Random& random) {
    const Size drawn = draw_size(random, 1, 2000);
    const ffseg::Size size{drawn.height, drawn.width};
    std::vector<float> heights = draw_floats(random, size.count());
    if (random.once_in(3)) spoil(random, heights);
    const std::vector<std::uint8_t> inside = draw_marks(random, drawn);
    const double step = random.pick({1e-6, 0.01, 1.0, 1e6});
    std::vector<float> out(evidence::kBarrierPlanes * size.count());
    evidence::barrier_planes(heights.data(), inside.data(), size, step, out.data());
    expect(std::all_of(out.begin() + static_cast<std::ptrdiff_t>(2 * size.count()), out.end(),
                       [](float v) { return v >= 0 && v <= 1; }),
           "a share beyond one");
    evidence::geodesic(heights.data(), inside.data(), size, step, random.pick({1, 2, 4095}), out.data());
    expect(std::all_of(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(size.count()),
                       [](float v) { return v >= 0 && std::isfinite(v); }),
           "a length below zero");
    const std::vector<float> above = draw_floats(random, size.count());
    std::vector<std::uint16_t> gradient = draw_gradient(random, drawn);
    std::vector<std::uint8_t> edges = draw_marks(random, drawn);
    const float width = random.pick({1e-3F, 1.2F, 1e5F});
    evidence::level_edges(above.data(), size, {random.pick({0.0F, 0.15F, kLargest}), width, width, 65535.0F},
                          gradient.data(), edges.data());
    expect(std::all_of(edges.begin(), edges.end(), [](std::uint8_t v) { return v == 0 || v == 255; }), "an edge pixel");
}

// Trees grown at random, then spoiled in a place or two: refused or evaluated, never out of bounds.
void forest(Random& random) {
    const int features = random.among(1, 6), trees = random.among(1, 5);
    std::vector<std::int32_t> feature, left, right, root;
    std::vector<float> threshold, value;
    for (int tree = 0; tree < trees; ++tree) {
        root.push_back(-1 - static_cast<std::int32_t>(value.size()));
        value.push_back(1);
        for (int n = random.below(34); n > 0; --n) {  // the root moves down a chain
            feature.push_back(random.below(features));
            threshold.push_back(static_cast<float>(random.between(-1, 1)));
            const auto leaf = -1 - static_cast<std::int32_t>(value.size());
            value.push_back(static_cast<float>(random.between(-1, 1)));
            const bool swap = random.once_in(2);
            left.push_back(swap ? leaf : root.back());
            right.push_back(swap ? root.back() : leaf);
            root.back() = static_cast<std::int32_t>(feature.size()) - 1;
        }
    }
    for (int n = random.below(3); n > 0; --n) {
        std::vector<std::int32_t>& which = *random.pick({&feature, &left, &right, &root});
        if (which.empty()) continue;
        which[static_cast<std::size_t>(random.below(static_cast<int>(which.size())))] =
            random.pick<std::int32_t>({0, 1, -1, -2, 7, 40, 2147483647, -2147483647 - 1});
    }
    if (random.once_in(8)) spoil(random, threshold.empty() ? value : threshold);
    const evidence::ForestArrays arrays{feature.data(), threshold.data(), left.data(),  right.data(), feature.size(),
                                        root.data(),    root.size(),      value.data(), value.size()};
    const Size drawn = draw_size(random, 1, 500);
    std::vector<float> planes = draw_floats(random, static_cast<std::size_t>(features) * drawn.count());
    spoil(random, planes);
    std::vector<float> out(drawn.count());
    try {
        const evidence::Forest grown(arrays, features);
        grown.score(planes.data(), drawn.count(), out.data());
        expect(std::all_of(out.begin(), out.end(), [](float v) { return std::isfinite(v); }), "a sum not finite");
    } catch (const std::invalid_argument&) {  // refused, as it may be
    }
}

}  // namespace fuzz
