#include "freeform/evolution.hpp"

#include <cassert>
#include <stdexcept>

#include "freeform/chain.hpp"
#include "freeform/components.hpp"
#include "freeform/filter.hpp"
#include "freeform/flip.hpp"
#include "freeform/move.hpp"
#include "freeform/refine.hpp"
#include "freeform/rest.hpp"
#include "freeform/settling/settle.hpp"
#include "freeform/settling/untangle.hpp"

namespace ffseg::freeform {

template <int D>
Chain<D>::Chain(const ContourSet& starts, const std::uint8_t* edges, const std::uint8_t* domain, int height, int width,
                const EvolutionOptions& options)
    : options_(options),
      field_(edges, domain, height, width),
      reached_(field_.num_tiles()),
      most_patches_(kMostPatches + height * (width / 16) + static_cast<int>(starts.points.size())) {
    options_.balloon = std::min(options_.balloon, kLongestStep * options_.split_threshold);
    for (std::size_t c = 0; c + 1 < starts.offsets.size(); ++c) {
        add_contour(starts.points.data() + starts.offsets[c], starts.offsets[c + 1] - starts.offsets[c]);
    }
    double area = 0.0;
    for (int loop : loops()) area += loop_area(loop);
    outside_filled_ = area < 0;
    std::vector<Vec2> samples;
    for (int i : active_) {
        for (const Vec2 sample : pool_[i].m) {
            if (!field_.blocked(sample)) samples.push_back(sample);
        }
    }
    const bool fits = options_.clearance <= 0 || field_.close_passages(edges, samples, options_.clearance);
    if (samples.empty() || !fits) reason_ = StopReason::kBlocked;
}

template <int D>
void Chain<D>::add_contour(const Vec2* points, std::size_t count) {
    const int patches = static_cast<int>(count / D);
    std::vector<int> made;
    for (int i = 0; i < patches; ++i) made.push_back(pool_.acquire());
    for (int i = 0; i < patches; ++i) {
        Points control;
        for (int k = 0; k <= D; ++k) control[k] = points[(static_cast<std::size_t>(i) * D + k) % count];
        pool_.link(made[i], made[(i + 1) % patches]);
        pool_.set_control(made[i], control);
        for (Vec2& sample : pool_[made[i]].m) sample = field_.clamp(sample);
        pool_[made[i]].before = pool_[made[i]].m;
    }
    for (int i : made) {
        pool_.refresh(i);
        pool_[i].active = true;
        active_.push_back(i);
        sorted_.push_back(i);
    }
}

template <int D>
void Chain<D>::wake(int i) {
    if (pool_[i].active || !pool_[i].alive) return;
    pool_[i].active = true;
    pool_[i].examined = false;
    active_.push_back(i);
}

template <int D>
void Chain<D>::release(int i) {
    pool_[i].alive = pool_[i].active = false;
    freed_.push_back(i);
}

// The curve may swing out of the image between samples that do not; what is sampled from it anew must not.
template <int D>
void Chain<D>::keep_inside(int i) {
    bool moved = false;
    for (Vec2& sample : pool_[i].m) {
        const Vec2 inside = field_.clamp(sample);
        moved = moved || inside.x != sample.x || inside.y != sample.y;
        sample = inside;
    }
    if (!moved) return;
    pool_.refresh(i);
    pool_.refresh(pool_[i].prev);
}

template <int D>
int Chain<D>::split(int i) {
    const int fresh = pool_.split(i);
    keep_inside(i);
    keep_inside(fresh);
    sorted_.push_back(fresh);
    if (pool_[fresh].active) active_.push_back(fresh);
    ++counts_.splits;
    return fresh;
}

// Slots freed in this iteration are reused only now, when no list names them any more.
template <int D>
void Chain<D>::forget_freed() {
    const auto dead = [this](int i) { return !pool_[i].alive; };
    if (!freed_.empty()) {
        const auto known = sorted_.begin() + static_cast<std::ptrdiff_t>(num_sorted_);
        num_sorted_ -= static_cast<std::size_t>(std::count_if(sorted_.begin(), known, dead));
        sorted_.erase(std::remove_if(sorted_.begin(), sorted_.end(), dead), sorted_.end());
    }
    active_.erase(std::remove_if(active_.begin(), active_.end(), [this](int i) { return !pool_[i].active; }),
                  active_.end());
    for (int i : freed_) pool_.release(i);
    freed_.clear();
}

template <int D>
bool Chain<D>::step() {
    ++counts_.iterations;
    move();
    guard();
    if (options_.refine) {
        reward_progress();
        refine();
    } else {
        for (int i : active_) pool_.refresh(i);
    }
    if (options_.topology) flip_crossings();
    rest();
    forget_freed();
    return !active_.empty();
}

template <int D>
bool Chain<D>::advance(int iterations) {
    for (int done = 0; done < iterations && reason_ == StopReason::kRunning; ++done) {
        if (counts_.iterations >= options_.max_iterations) {
            reason_ = StopReason::kMaxIterations;
        } else if (pool_.num_alive() > most_patches_) {
            reason_ = StopReason::kMaxPatches;
        } else if (!step() && !(options_.refine && wake_open())) {
            if (options_.topology) drop_nested();
            forget_freed();
            reason_ = sorted_.empty() ? StopReason::kVanished : num_stray_ > 0 ? StopReason::kStalled : StopReason::kConverged;
            assert(reason_ != StopReason::kConverged || !options_.refine || all_held());
        }
    }
    return reason_ == StopReason::kRunning;
}

template <int D>
std::vector<int> Chain<D>::loops() const {
    std::vector<int> firsts;
    std::vector<bool> seen(static_cast<std::size_t>(pool_.size()));
    for (int i = 0; i < pool_.size(); ++i) {
        if (!pool_[i].alive || seen[static_cast<std::size_t>(i)]) continue;
        firsts.push_back(i);
        for (int at = i; !seen[static_cast<std::size_t>(at)]; at = pool_[at].next) seen[static_cast<std::size_t>(at)] = true;
    }
    return firsts;
}

template <int D>
std::vector<Samples> Chain<D>::sampled() const {
    std::vector<Samples> out;
    for (int loop : loops()) {
        out.emplace_back();
        each_in_loop(loop, [&](int i) { out.back().insert(out.back().end(), pool_[i].m.begin(), pool_[i].m.end()); });
    }
    return out;
}

template <int D>
void Chain<D>::settle(const GradientView& gradient) {
    if (options_.settle <= 0) return;
    const settling::Ridge ridge(gradient, options_.ridge_low);
    settling::Settling<D> settle_on(field_, ridge, options_.settle);
    for (Samples& component : sampled()) {
        const double spacing = options_.split_threshold / D;
        settled_.push_back(settle_on.run(std::move(component), options_.refine, spacing, counts_.splits));
    }
    if (options_.topology) settling::Untangle<D>(settled_).run();
}

template <int D>
ContourSet Chain<D>::contours() const {
    ContourSet out;
    for (const Samples& samples : settled_.empty() ? sampled() : settled_) {
        out.points.reserve(out.points.size() + samples.size());
        for (std::size_t first = 0; first < samples.size(); first += D) {
            const Points points = patch_of<D>(samples, first);
            out.points.push_back(points[0]);
            for (int k = 1; k < D; ++k) out.points.push_back(apply<D>(kBasis<D>.inverse[k], points));
        }
        out.offsets.push_back(out.points.size());
    }
    return out;
}

std::unique_ptr<Evolution> make_evolution(const ContourSet& starts, const std::uint8_t* edges,
                                          const std::uint8_t* domain, int height, int width,
                                          const EvolutionOptions& options) {
    const auto make = [&](auto degree) -> std::unique_ptr<Evolution> {
        return std::make_unique<Chain<decltype(degree)::value>>(starts, edges, domain, height, width, options);
    };
    switch (options.degree) {
        case 1: return make(std::integral_constant<int, 1>{});
        case 2: return make(std::integral_constant<int, 2>{});
        case 3: return make(std::integral_constant<int, 3>{});
        case 4: return make(std::integral_constant<int, 4>{});
        case 5: return make(std::integral_constant<int, 5>{});
        case 6: return make(std::integral_constant<int, 6>{});
        default: throw std::invalid_argument("the degree must be 1 to 6");
    }
}

}  // namespace ffseg::freeform
