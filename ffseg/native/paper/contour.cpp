#include "paper/contour.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace ffseg::paper {
namespace {

struct Entry {
    Box box;
    Place place;
};

// Patches by their boxes, lexicographically.
std::vector<Entry> sorted(Contour& contour) {
    std::vector<Entry> entries;
    for (std::size_t c = 0; c < contour.components.size(); ++c) {
        for (std::size_t i = 0; i < contour.components[c].size(); ++i) {
            entries.push_back({contour.basis.box(contour.components[c][i]), {c, i}});
        }
    }
    std::stable_sort(entries.begin(), entries.end(), [&](const Entry& a, const Entry& b) {
        ++contour.counts.comparisons;
        return std::tie(a.box.x0, a.box.y0, a.box.x1, a.box.y1) < std::tie(b.box.x0, b.box.y0, b.box.x1, b.box.y1);
    });
    return entries;
}

bool adjacent(const Contour& contour, Place a, Place b) {
    if (a.component != b.component) return false;
    const std::size_t count = contour.components[a.component].size();
    return (a.patch + 1) % count == b.patch || (b.patch + 1) % count == a.patch;
}

// Calls visit(a, b) with a before b for patches that are not adjacent and whose boxes meet, until it returns true.
template <typename Visit>
bool visit_meeting(Contour& contour, Visit visit) {
    const std::vector<Entry> entries = sorted(contour);
    for (std::size_t at = 0; at < entries.size(); ++at) {
        for (std::size_t next = at + 1; next < entries.size(); ++next) {
            ++contour.counts.box_tests;
            if (entries[next].box.x0 > entries[at].box.x1) break;
            if (!entries[at].box.meets(entries[next].box)) continue;
            Place a = entries[at].place, b = entries[next].place;
            if (adjacent(contour, a, b)) continue;
            if (std::tie(b.component, b.patch) < std::tie(a.component, a.patch)) std::swap(a, b);
            if (visit(a, b)) return true;
        }
    }
    return false;
}

// Gamma'_i = [P_0i .. P_ki, P_(k+1)j .. P_dj] and Gamma'_j = [P_0j .. P_kj, P_(k+1)i .. P_di], k = floor(d / 2).
std::pair<Patch, Patch> swapped(const Patch& p, const Patch& q, int degree) {
    std::pair<Patch, Patch> made{p, q};
    for (int a = degree / 2 + 1; a <= degree; ++a) std::swap(made.first[a], made.second[a]);
    return made;
}

// Signed area of the control polygon.
double area(const Component& component, int degree) {
    const Vec2 origin = component[0][0];
    double twice = 0.0;
    for (const Patch& patch : component) {
        for (int k = 0; k < degree; ++k) twice += cross(patch[k] - origin, patch[k + 1] - origin);
    }
    return 0.5 * twice;
}

// One component becomes two: what runs on from i to the successors of j, and what lies between them. The one that
// encloses more goes on as Gamma_out, the other one is set aside as Gamma_inn.
void separate(Contour& contour, Place i, Place j, const std::pair<Patch, Patch>& made) {
    const Component whole = contour.components[i.component];
    const auto at = [&](std::size_t n) { return whole.begin() + static_cast<std::ptrdiff_t>(n); };
    Component outer(whole.begin(), at(i.patch)), inner{made.second};
    outer.push_back(made.first);
    outer.insert(outer.end(), at(j.patch + 1), whole.end());
    inner.insert(inner.end(), at(i.patch + 1), at(j.patch));
    const int degree = contour.basis.degree();
    if (std::abs(area(inner, degree)) > std::abs(area(outer, degree))) std::swap(inner, outer);
    contour.components[i.component] = outer;
    contour.inner.push_back(inner);
}

// Two components become one.
void merge(Contour& contour, Place i, Place j, const std::pair<Patch, Patch>& made) {
    Component first = contour.components[i.component], second = contour.components[j.component];
    const auto at = [](Component& c, std::size_t n) { return c.begin() + static_cast<std::ptrdiff_t>(n); };
    Component merged(first.begin(), at(first, i.patch));
    merged.push_back(made.first);
    merged.insert(merged.end(), at(second, j.patch + 1), second.end());
    merged.insert(merged.end(), second.begin(), at(second, j.patch));
    merged.push_back(made.second);
    merged.insert(merged.end(), at(first, i.patch + 1), first.end());
    contour.components[i.component] = merged;
    contour.components.erase(contour.components.begin() + static_cast<std::ptrdiff_t>(j.component));
    ++contour.counts.merges;
}

// Flips i and j when their control polygons cross and those of the new patches do not. Where patches of two components
// overlap (cross twice) but run the same way, the second component is turned round first (Remark on orientation).
bool flip_pair(Contour& contour, Place i, Place j) {
    const Basis& basis = contour.basis;
    const Patch p = contour.components[i.component][i.patch], q = contour.components[j.component][j.patch];
    int crossings = 0;
    ++contour.counts.polygon_tests;
    if (!basis.cross(p, q, &crossings)) return false;
    std::pair<Patch, Patch> made = swapped(p, q, basis.degree());
    if (basis.cross(made.first, made.second)) {
        if (i.component == j.component || crossings != 2) return false;
        Component& second = contour.components[j.component];
        const Component turned = reversed(second, basis.degree());
        const std::size_t at = second.size() - 1 - j.patch;
        made = swapped(p, turned[at], basis.degree());
        if (basis.cross(made.first, made.second)) return false;
        second = turned;
        j.patch = at;
        ++contour.counts.reversals;
    }
    (i.component == j.component ? separate : merge)(contour, i, j, made);
    ++contour.counts.flips;
    return true;
}

}  // namespace

std::size_t Contour::num_patches() const {
    std::size_t count = 0;
    for (const Component& component : components) count += component.size();
    return count;
}

void split(Contour& contour, double threshold) {
    for (Component& component : contour.components) {
        Component made;
        for (const Patch& patch : component) {
            if (contour.basis.spread2(patch) > threshold * threshold) {
                const auto [first, second] = contour.basis.halves(patch);
                made.insert(made.end(), {first, second});
                ++contour.counts.splits;
            } else {
                made.push_back(patch);
            }
        }
        component = made;
    }
}

void prune(Contour& contour, double threshold) {
    const int degree = contour.basis.degree();
    const auto short_enough = [&](const Patch& a, const Patch& b) {
        double most = std::max(contour.basis.spread2(a), contour.basis.spread2(b));
        for (int i = 0; i <= degree; ++i) {
            for (int k = 0; k <= degree; ++k) most = std::max(most, norm2(b[k] - a[i]));
        }
        return most < 0.25 * threshold * threshold;
    };
    for (Component& component : contour.components) {
        Component made;
        std::size_t left = component.size();  // so many patches the component would have
        for (std::size_t i = 0; i < component.size(); ++i) {
            const bool last = i + 1 == component.size();
            if (last || left <= 2 || !short_enough(component[i], component[i + 1])) {
                made.push_back(component[i]);
                continue;
            }
            Patch joined{};
            for (int k = 0; k <= degree; ++k) {
                joined[k] = 2 * k <= degree ? component[i][2 * k] : component[i + 1][2 * k - degree];
            }
            made.push_back(joined);
            --left;
            ++i;
            ++contour.counts.prunes;
        }
        component = made;
    }
}

std::vector<std::pair<Place, Place>> meeting(Contour& contour) {
    std::vector<std::pair<Place, Place>> found;
    visit_meeting(contour, [&](Place a, Place b) {
        found.emplace_back(a, b);
        return false;
    });
    return found;
}

void flip(Contour& contour) {
    for (std::size_t most = contour.num_patches(); most > 0 && !contour.is_spent(); --most) {
        if (!visit_meeting(contour, [&](Place a, Place b) { return flip_pair(contour, a, b); })) return;
    }
}

Component reversed(const Component& component, int degree) {
    Component turned(component.rbegin(), component.rend());
    for (Patch& patch : turned) std::reverse(patch.begin(), patch.begin() + degree + 1);
    return turned;
}

}  // namespace ffseg::paper
