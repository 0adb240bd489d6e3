// Moving the samples along their normals, and the promise that the curve never enters an edge band.
#pragma once
#include "freeform/chain.hpp"

namespace ffseg {

// How far a point may move along `normal`, at most `wanted`, before it meets what is blocked; `known` pixels are free.
template <int D>
double Chain<D>::reach(Vec2 from, Vec2 normal, double wanted, double known) const {
    const double limit = std::min(wanted, std::max(kCautiousStep, known));
    double s = std::min(limit, known);
    while (s < limit) {
        const double ahead = std::min(s + kMarchStep, limit);
        if (field_.blocked(from + ahead * normal)) break;
        s = ahead;
    }
    return s;
}

// The tangents of the Bezier curve at its samples and the distances between them, before anything moves.
template <int D>
void Chain<D>::measure(int i, Motion& motion) {
    motion.points = pool_.samples(i);
    for (int k = 0; k < D; ++k) motion.tangent[k] = unit(apply<D>(kBasis<D>.slope[k], motion.points));
    pool_[i].end_tangent = unit(apply<D>(kBasis<D>.slope[D], motion.points));
    for (int k = 0; k < D; ++k) motion.chord[k] = norm(motion.points[k + 1] - motion.points[k]);
    pool_[i].last_chord = motion.chord[D - 1];
}

template <int D>
void Chain<D>::move_patch(int i, const Motion& motion) {
    Patch<D>& patch = pool_[i];
    const Patch<D>& prev = pool_[patch.prev];
    patch.steady = patch.reverted = 0;
    double free = field_.free_reach(motion.points[D]);
    bool crowded = free <= 0;
    for (int k = D - 1; k >= 0; --k) {
        const double ahead = free;
        free = field_.free_reach(motion.points[k]);
        // Could the curve between this sample and the next, wherever they move now, be near anything blocked?
        crowded = crowded || free + ahead < kBulge * motion.chord[k] + 2 * options_.balloon;
        const Vec2 tangent = k > 0 ? motion.tangent[k] : unit(motion.tangent[0] + prev.end_tangent);
        const Vec2 normal{tangent.y, -tangent.x};
        const double s = reach(motion.points[k], normal, options_.balloon, free);
        Vec2 to = motion.points[k] + s * normal;
        if (free > s + 1.0) {  // even out the spacing along the tangent; the shape keeps to first order
            const double back = k > 0 ? motion.chord[k - 1] : prev.last_chord;
            to += std::min(std::max(0.25 * (motion.chord[k] - back), -1.0), 1.0) * tangent;
        }
        if (s < kSteady) patch.steady |= static_cast<std::uint8_t>(1u << k);
        patch.before[k] = to;  // swapped with m when every sample has its target
    }
    patch.crowded = crowded;
}

// All samples move at once (Eq. 7 with displacements along the normals, at a joint along the mean of both patches').
template <int D>
void Chain<D>::move() {
    motion_.resize(active_.size());
    for (std::size_t at = 0; at < active_.size(); ++at) measure(active_[at], motion_[at]);
    for (std::size_t at = 0; at < active_.size(); ++at) move_patch(active_[at], motion_[at]);
    const std::size_t count = active_.size();
    for (std::size_t at = 0; at < count; ++at) {
        const int i = active_[at], prev = pool_[i].prev;
        std::swap(pool_[i].m, pool_[i].before);
        if (pool_[prev].active || (pool_[i].steady & 1u) != 0) continue;
        pool_[prev].before = pool_[prev].m;
        pool_[prev].steady = kAllSteady;
        pool_[prev].reverted = 0;
        pool_[prev].crowded = true;
        wake(prev);
    }
}

// The square of the longest of some steps.
template <int D>
float widest2(const Places<D>& step) {
    Float4 most = all(0.0f);
    for (int q = 0; q < Places<D>::kFours; ++q) most = larger(most, step.x[q] * step.x[q] + step.y[q] * step.y[q]);
    return std::max(std::max(most[0], most[1]), std::max(most[2], most[3]));
}

// Does the curve between samples k and k + 1 meet an edge? Edges are 4-connected chains of pixels, at least 0.7 pixels
// thick; with the band round them they are three pixels thick, so that none hides between two places off the band that
// lie nearer to each other. The places looked at lie about evenly, but for a curve just made, which may swing about.
template <int D>
template <bool kMaySwing>
bool Chain<D>::interval_hits(const Points& points, int k) const {
    constexpr int kSub = Basis<D>::kSub;
    const double chord2 = norm2(points[k + 1] - points[k]), part = (kMaySwing ? kSwing : 1.0) * kBulge;
    const double free = field_.free_reach(points[k]) + field_.free_reach(points[k + 1]);
    if (free > 0 && free * free >= part * part * chord2) return false;
    const Places<D> at(kBasis<D>.looks[k], points);
    const unsigned seen = field_.look(at.x, at.y) | field_.look(points[k + 1]);
    if (Field::is_solid(seen)) return true;
    float gap2 = static_cast<float>(chord2) / (kSub * kSub);  // between two places looked at, squared
    if constexpr (kMaySwing) gap2 = widest2(Places<D>(kBasis<D>.strides[k], points));
    if (gap2 <= (seen == 0 ? kLookAfar * kLookAfar : kLookEvery * kLookEvery)) return false;
    const Places<D> stride(kBasis<D>.strides[k], points);
    const int pieces = 1 + static_cast<int>(std::sqrt(gap2) / kLookEvery);
    for (int piece = 1; piece < pieces; ++piece) {  // straight, between the places looked at
        const float u = static_cast<float>(piece) / static_cast<float>(pieces);
        auto x = at.x, y = at.y;
        for (int q = 0; q < Places<D>::kFours; ++q) {
            x[q] = x[q] + stride.x[q] * u;
            y[q] = y[q] + stride.y[q] * u;
        }
        if (Field::is_solid(field_.look(x, y))) return true;
    }
    return false;
}

// The first stretch of a patch that meets an edge, -1 if none does.
template <int D>
template <bool kMaySwing>
int Chain<D>::first_hit(int i) const {
    const Points points = pool_.samples(i);
    for (int k = 0; k < D; ++k) {
        if (interval_hits<kMaySwing>(points, k)) return k;
    }
    return -1;
}

// The number of stretches of a patch just made that meet an edge.
template <int D>
int Chain<D>::num_hits(int i) const {
    const Points points = pool_.samples(i);
    int hits = 0;
    for (int k = 0; k < D; ++k) hits += interval_hits<true>(points, k);
    return hits;
}

// Puts sample k of patch i (k = D: the next patch's joint) back where it was. False if it already is.
template <int D>
bool Chain<D>::put_back(int i, int k) {
    const int owner = k == D ? pool_[i].next : i, at = k == D ? 0 : k;
    Patch<D>& patch = pool_[owner];
    const auto bit = static_cast<std::uint8_t>(1u << at);
    if (!patch.active || (patch.reverted & bit) != 0) return false;
    patch.reverted |= bit;
    patch.steady |= bit;
    patch.m[at] = patch.before[at];
    if (at == 0) queue_.push_back(k == D ? owner : patch.prev);
    return true;
}

// Puts samples back until the curve meets no edge; the state before the move met none. Says whether it was stopped.
template <int D>
bool Chain<D>::guard_patch(int i) {
    bool stopped = false;
    for (int tries = 0; tries <= D; ++tries) {
        const int k = first_hit<false>(i);
        if (k < 0) break;
        stopped = true;
        const bool left = put_back(i, k), right = put_back(i, k + 1);
        if (left || right) continue;
        bool any = false;  // the samples farther off bend the curve here as well, the less the farther
        for (int ring = 1; ring < D && !any; ++ring) {
            any = k >= ring && put_back(i, k - ring);
            any = (k + 1 + ring <= D && put_back(i, k + 1 + ring)) || any;
        }
        if (!any) break;
    }
    return stopped;
}

template <int D>
void Chain<D>::guard() {
    queue_.clear();
    for (int i : active_) {
        const Patch<D>& patch = pool_[i];
        const bool still = patch.steady == kAllSteady && (pool_[patch.next].steady & 1u) != 0;
        if (patch.crowded && !still && guard_patch(i)) pool_[i].wants_split = true;
    }
    for (std::size_t at = 0; at < queue_.size(); ++at) {
        const int i = queue_[at];
        if (guard_patch(i)) pool_[i].wants_split = true;
    }
}

// A patch near edges that gets on has all its repairs again: as often as there are tiles, so the evolution ends.
template <int D>
void Chain<D>::reward_progress() {
    for (const int i : active_) {
        Patch<D>& patch = pool_[i];
        if (patch.budget > kSplitBudget / 2) continue;
        for (int k = 0; k < D; ++k) {
            std::uint8_t& tile = reached_[field_.tile(patch.m[k])];
            if (tile == 0 && (patch.steady >> k & 1u) == 0) {
                tile = 1;
                patch.budget = kSplitBudget;
            }
        }
    }
}

// Could the curve of a resting patch still advance between its samples?
template <int D>
template <bool kClosely>
bool Chain<D>::uncovered(int i) const {
    const Points points = pool_.samples(i);
    for (int k = 0; k < D; ++k) {
        if (open_ahead<kClosely>(points, k)) return true;
    }
    return false;
}

// Is there room ahead of a place between samples k and k + 1? Several are looked at side by side, a step farther along
// their normals as long as one of them is free; once more closely, at places between those.
template <int D>
template <bool kClosely>
bool Chain<D>::open_ahead(const Points& points, int k) const {
    constexpr int kSub = Basis<D>::kSub, kSteps = static_cast<int>(kUncovered / kMarchStep);
    const double chord = norm(points[k + 1] - points[k]);
    if (chord < (kClosely ? kSub * kCloseLook : 2 * kMinSpacing)) return false;
    const int apart = chord <= 3.0 ? 4 : chord <= 6.0 ? 2 : 1;
    const int pieces = kClosely ? static_cast<int>(std::ceil(chord / (kSub * kCloseLook))) : 1;
    const Places<D> first(kBasis<D>.looks[k], points), stride(kBasis<D>.strides[k], points);
    Places<D> along(kBasis<D>.headings[k], points);
    std::array<bool, kSub> wanted{};
    for (int j = 0; j < kSub; j += apart) {
        const float dx = along.x[j / 4][j % 4], dy = along.y[j / 4][j % 4], size = std::sqrt(dx * dx + dy * dy);
        wanted[j] = size > 0;
        along.x[j / 4][j % 4] = wanted[j] ? dx * static_cast<float>(kMarchStep) / size : 0.0f;
        along.y[j / 4][j % 4] = wanted[j] ? dy * static_cast<float>(kMarchStep) / size : 0.0f;
    }
    for (int piece = kClosely ? 1 : 0; piece < pieces; ++piece) {
        const float u = static_cast<float>(piece) / static_cast<float>(pieces);
        Places<D> at = first;
        for (int q = 0; q < Places<D>::kFours; ++q) {
            at.x[q] = at.x[q] + stride.x[q] * u;
            at.y[q] = at.y[q] + stride.y[q] * u;
        }
        std::array<bool, kSub> free = wanted;
        free[0] = free[0] && piece > 0;  // the first is a sample
        bool any = true;
        for (int step = 0; step <= kSteps && any; ++step) {
            any = false;
            for (int q = 0; q < Places<D>::kFours; ++q) {
                const auto cells = field_.cells(at.x[q], at.y[q]);
                for (int j = 0; j < 4; ++j) {
                    free[4 * q + j] &= !field_.blocked(cells[j]);
                    any |= free[4 * q + j];
                }
                at.x[q] = at.x[q] + along.y[q];
                at.y[q] = at.y[q] - along.x[q];
            }
        }
        if (any) return true;
    }
    return false;
}

// Is the nearest blocked pixel farther from p, which nothing stops along the normal, than an edge band is wide?
inline bool in_the_open(const Field& field, Vec2 p) {
    for (const int far : {1, kBandWidth}) {  // mostly it is the next one
        for (int dy = -far; dy <= far; ++dy) {
            for (int dx = -far; dx <= far; ++dx) {
                if (field.blocked(p + Vec2{static_cast<double>(dx), static_cast<double>(dy)})) return false;
            }
        }
    }
    return true;
}

// Moves samples at rest aslant where their normals are blocked but there is room beside: at the mouth of a narrow passage
// the normal may point at its side. To each pixel only once, so that it ends.
template <int D>
bool Chain<D>::slide(int i) {
    static constexpr std::array<Vec2, 4> kAslant{{{0.866, 0.5}, {0.866, -0.5}, {0.5, 0.866}, {0.5, -0.866}}};  // 30 and 60 degrees
    Patch<D>& patch = pool_[i];
    bool any = false;
    const Points before = pool_.samples(patch.prev);
    for (int k = 0; k < D; ++k) {
        const Points points = pool_.samples(i);
        const Vec2 leaving = unit(apply<D>(kBasis<D>.slope[k], points));
        const Vec2 arriving = k > 0 ? leaving : unit(apply<D>(kBasis<D>.slope[D], before));
        const double ahead = norm2(points[k + 1] - points[k]);
        const double behind = norm2(points[k] - (k > 0 ? points[k - 1] : before[D - 1]));
        if (std::min(ahead, behind) > kTipChord * kTipChord && dot(leaving, arriving) > kTipTurn) continue;
        const Vec2 tangent = unit(leaving + arriving), normal{tangent.y, -tangent.x};
        for (const Vec2 turn : kAslant) {
            const Vec2 way = turn.x * normal + turn.y * tangent;
            if (reach(points[k], way, kUncovered, 0.0) < kUncovered) continue;
            const Vec2 to = points[k] + kUncovered * way;
            if (!retried_.insert(field_.pixel(to)).second) continue;
            const auto kept = patch.m[k];
            patch.m[k] = to;
            if (meets_edge(i) || (k == 0 && meets_edge(patch.prev))) {
                patch.m[k] = kept;
                continue;
            }
            any = true;
            break;
        }
    }
    if (!any) return false;
    patch.before = patch.m;
    pool_.refresh(i);
    pool_.refresh(patch.prev);
    wake(patch.prev);
    wake(i);
    return true;
}

// Was a sample of a patch at rest put back although there is room ahead of it?
template <int D>
bool Chain<D>::held_back(int i) const {
    const Patch<D>& patch = pool_[i];
    if (patch.reverted == 0) return false;
    const Points points = pool_.samples(i);
    for (int k = 0; k < D; ++k) {
        if ((patch.reverted >> k & 1u) == 0) continue;
        const Vec2 tangent = unit(apply<D>(kBasis<D>.slope[k], points));
        if (reach(points[k], {tangent.y, -tangent.x}, kHeldBack, 0.0) >= kHeldBack) return true;
    }
    return false;
}

// Has every sample something that blocks it within the width of an edge band?
template <int D>
bool Chain<D>::all_held() const {
    return std::all_of(sorted_.begin(), sorted_.end(), [this](int i) {
        const auto& samples = pool_[i].m;
        return std::none_of(samples.begin(), samples.end(), [this](Vec2 p) { return in_the_open(field_, p); });
    });
}

// Before the contour counts as converged every patch at rest is looked at closely: where it could still advance it is
// woken with all its repairs. Says whether any was. A place is tried once only, so that this ends; a sample that lies in
// the open even so is counted.
template <int D>
bool Chain<D>::wake_open() {
    num_stray_ = 0;
    const std::size_t count = sorted_.size();
    for (std::size_t at = 0; at < count; ++at) {
        const int i = sorted_[at];
        if (!pool_[i].alive || pool_[i].examined) continue;
        const auto& samples = pool_[i].m;
        const auto stray = std::find_if(samples.begin(), samples.end(), [this](Vec2 p) { return in_the_open(field_, p); });
        const bool open = stray != samples.end();
        num_stray_ += open;
        const bool ahead = open || (splittable(i) && (pool_[i].starved || held_back(i) || uncovered<true>(i)));
        if (ahead && retried_.insert(field_.pixel(open ? *stray : samples[0])).second) {
            pool_[i].budget = kSplitBudget;
            pool_[i].calmed = 0;
            wake(i);
            if (splittable(i)) split(i);
        } else if (!slide(i)) {
            pool_[i].examined = !open;
        }
    }
    return !active_.empty();
}

}  // namespace ffseg
