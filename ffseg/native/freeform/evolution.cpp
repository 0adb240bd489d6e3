#include "freeform/evolution.hpp"

#include <algorithm>
#include <cassert>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "freeform/contour.hpp"
#include "freeform/deform.hpp"
#include "freeform/guard.hpp"
#include "freeform/refine.hpp"
#include "freeform/resting/rest.hpp"
#include "freeform/settling/settle.hpp"
#include "freeform/settling/untangle.hpp"
#include "freeform/topology/flip.hpp"

namespace ffseg::freeform {
namespace {

using settling::Samples;

// Patches allowed in addition to one per 16 pixels. Only a contour that winds over itself without end exceeds them.
constexpr int kExtraPatches = 1000;
// Times that a resting front is tested again against the colours of what it has swept meanwhile.
constexpr int kMaxRounds = 32;

// The loop of Algorithm 4, which begins with a contour that needs no split or flip yet. True while the contour moves.
template <int D>
bool evolve(Contour<D>& contour) {
    ++contour.counts.iterations;
    contour.effort.work += contour.active.size();
    deform(contour);                  // sample each patch, compute the deformation there, deform the patch (Eq. 7)
    hold_at_edges(contour);           // nothing enters an edge (Section 3.2)
    split_and_prune(contour);         // split and insert (Algorithm 2)
    if (contour.options.topology) topology::flip_crossings(contour);  // flip (Algorithm 3)
    contour.effort.work += (contour.effort.visits + contour.order.size()) / topology::kMaxVisits;
    resting::bring_to_rest(contour);  // what has converged moves no more
    contour.reclaim();
    return !contour.active.empty();
}

// The samples of each component.
template <int D>
std::vector<Samples> samples_of(const Contour<D>& contour) {
    std::vector<Samples> out;
    for (int component : contour.components()) {
        out.emplace_back();
        contour.each_in(component,
                        [&](int i) { out.back().insert(out.back().end(), contour[i].m.begin(), contour[i].m.end()); });
    }
    return out;
}

template <int D>
class Evolving final : public Evolution {
public:
    Evolving(const ContourSet& starts, const std::uint8_t* edges, const std::uint8_t* domain, int height, int width,
             const EvolutionOptions& options, const Picture& colours)
        : contour_(starts, edges, domain, height, width, options),
          most_patches_(kExtraPatches + height * (width / 16) + static_cast<int>(starts.points.size())) {
        double area = 0.0;
        for (int component : contour_.components()) area += topology::component_area(contour_, component);
        contour_.outside_filled = area < 0;
        std::vector<Vec2> samples;
        for (int i : contour_.active) {
            for (const Vec2 sample : contour_[i].m) {
                if (!contour_.field.blocked(sample)) samples.push_back(sample);
            }
        }
        const bool fits =
            options.clearance <= 0 || contour_.field.close_passages(edges, samples, options.clearance, options.plane);
        if (samples.empty() || !fits) reason_ = Stop::kBlocked;
        if (colours.pixels != nullptr && options.weight > 0) {
            contour_.pressure = std::make_unique<region::Pressure>(colours, options.weight, options.window);
        }
    }

    bool advance(int iterations) override {
        for (int done = 0; done < iterations && reason_ == Stop::kRunning; ++done) {
            if (contour_.counts.iterations >= contour_.options.max_iterations) {
                reason_ = Stop::kMaxIterations;
            } else if (contour_.num_alive() > most_patches_) {
                reason_ = Stop::kMaxPatches;
            } else if (contour_.options.budget > 0 && contour_.effort.work > contour_.options.budget) {
                reason_ = Stop::kBudget;
            } else {
                if (contour_.pressure != nullptr && contour_.counts.iterations >= next_fit_) fit_pressure();
                if (!evolve(contour_) && !(contour_.options.refine && (resting::wake_open(contour_) || wake_anew())))
                    finish();
            }
        }
        return reason_ == Stop::kRunning;
    }

    // Attraction to edges (Section 3.2), once the contour has stopped; what crosses or bounds nothing then is mended.
    void settle(const GradientView& gradient) override {
        const EvolutionOptions& options = contour_.options;
        std::vector<Samples>& settled = settled_.emplace(samples_of(contour_));
        if (options.settle > 0) {
            const settling::Ridge ridge(gradient, options.ridge_low);
            settling::Settling<D> settling(contour_.field, ridge, options.settle);
            const double spacing = options.split_threshold / D;
            for (Samples& component : settled) {
                component = settling.run(std::move(component), options.refine, spacing, contour_.counts.splits);
            }
        }
        if (!options.topology || !settling::Untangle<D>(settled).run()) return;
        const std::vector<bool> bounding = settling::bounding(settled, contour_.outside_filled);
        for (std::size_t i = settled.size(); i-- > 0;) {
            if (!bounding[i]) settled.erase(settled.begin() + static_cast<std::ptrdiff_t>(i));
        }
    }

    ContourSet contours() const override {
        ContourSet out;
        for (const Samples& samples : settled_ ? *settled_ : samples_of(contour_)) {
            out.points.reserve(out.points.size() + samples.size());
            for (std::size_t first = 0; first < samples.size(); first += D) {
                const Points<D> points = settling::patch_of<D>(samples, first);
                out.points.push_back(points[0]);
                for (int k = 1; k < D; ++k) out.points.push_back(apply<D>(kBasis<D>.inverse[k], points));
            }
            out.offsets.push_back(out.points.size());
        }
        return out;
    }

    const EvolutionCounts& counts() const override { return contour_.counts; }
    Stop stop_reason() const override { return reason_; }
    std::size_t work() const override { return contour_.effort.work; }

private:
    // What has been swept is learned at the start, then whenever the iterations have doubled.
    void fit_pressure() {
        const ContourSet now = contours();
        contour_.pressure->fit({now.points, now.offsets, D}, contour_.outside_filled);
        next_fit_ = std::max(1, 2 * contour_.counts.iterations);
    }

    // A front that the colours hold is asked again by all that it has swept since. Says whether any patch was woken.
    bool wake_anew() {
        if (contour_.pressure == nullptr || rounds_ == kMaxRounds) return false;
        ++rounds_;
        fit_pressure();
        contour_.memory.retried.clear();
        for (int i : contour_.order) contour_[i].examined = false;
        return resting::wake_open(contour_);
    }

    void finish() {
        if (contour_.options.topology) {
            const std::vector<int> loops = contour_.components();
            const std::vector<bool> bounding = settling::bounding(samples_of(contour_), contour_.outside_filled);
            for (std::size_t i = 0; i < loops.size(); ++i) {
                if (!bounding[i]) topology::drop(contour_, loops[i]);
            }
        }
        contour_.reclaim();
        reason_ = contour_.order.empty()          ? Stop::kVanished
                  : contour_.memory.num_stray > 0 ? Stop::kStalled
                                                  : Stop::kConverged;
        assert(reason_ != Stop::kConverged || !contour_.options.refine || resting::all_held(contour_));
    }

    Contour<D> contour_;
    std::optional<std::vector<Samples>> settled_;
    Stop reason_ = Stop::kRunning;
    int most_patches_;
    int next_fit_ = 0, rounds_ = 0;  // of the pressure by colour
};

}  // namespace

std::unique_ptr<Evolution> make_evolution(const ContourSet& starts, const std::uint8_t* edges,
                                          const std::uint8_t* domain, int height, int width,
                                          const EvolutionOptions& options, const Picture& colours) {
    const auto make = [&](auto degree) -> std::unique_ptr<Evolution> {
        return std::make_unique<Evolving<decltype(degree)::value>>(starts, edges, domain, height, width, options,
                                                                   colours);
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
