"""Small faults to be put into the code, one at a time: a sign, an index, a comparison, a condition left out, a constant.

Each names its file, the text it takes the place of (which the file holds once) and what stands there instead: an expression
for an expression, a statement for a statement.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutant:
    """One fault."""

    file: str  # below ffseg/
    old: str
    new: str
    effect: str = ""  # why nothing can notice it, where that is so

    @property
    def name(self) -> str:
        """Where it is and what it does, in one line."""
        old, new = (" ".join(text.split()) for text in (self.old, self.new))
        return f"{self.file.rpartition('/')[2]}: {old[:60]} -> {new[:60] or 'left out'}"


def _of(file: str, *changes: tuple[str, str] | tuple[str, str, str]) -> list[Mutant]:
    return [Mutant(file, *change) for change in changes]


FREEFORM = "native/freeform/"
NATIVE = [
    *_of(
        FREEFORM + "topology/exchange.hpp",
        (
            "for (int a = D / 2 + 1; a <= D; ++a) std::swap(p[a], q[a]);",
            "for (int a = D / 2 + 2; a <= D; ++a) std::swap(p[a], q[a]);",
        ),
        ("if (visit_crossings(p, q, [](int, int) { return true; })) return false;", ""),
        (
            "contour.link(i, after_j);\n        contour.link(j, after_i);",
            "contour.link(i, after_i);\n        contour.link(j, after_j);",
        ),
        ("cross(p[a + 1] - p[a], q[b + 1] - q[b]) > 0 ? i : j", "cross(p[a + 1] - p[a], q[b + 1] - q[b]) > 0 ? j : i"),
        ("crossings == 1 ? inner : -1", "inner"),
        ("(from / (from - to))", "(to / (from - to))"),
        ("num_hits(contour, i) + num_hits(contour, j) <= before", "true"),
        ("even[k] = along.at(along.length() * k / D);", "even[k] = along.at(along.length() * k / (D + 1));"),
    ),
    *_of(
        FREEFORM + "topology/flip.hpp",
        ("flip_adjacent(contour, contour.active[at]);", ""),
        ("contour[changed].touched = contour[changed].near_edges = true;", "contour[changed].near_edges = true;"),
        ("round < kFlipRounds && crossing", "round < 1 && crossing"),
        ("std::max(contour.length(i), contour.length(j)) > kFlipLength", "false"),
    ),
    *_of(
        FREEFORM + "topology/adjacent.hpp",
        ("contour.field.encloses_solid(both.data(), both.size())", "false"),
        (
            "for (int a = D / 2 + 1; a <= D; ++a) joined[a] = q[a];",
            "for (int a = D / 2 + 2; a <= D; ++a) joined[a] = q[a];",
        ),
    ),
    *_of(
        FREEFORM + "topology/filter.hpp",
        ("strip_of(box.y1)", "strip_of(box.y0)"),
    ),
    *_of(
        FREEFORM + "topology/classify.hpp",
        ("std::abs(area) < kVoidArea", "false"),
        ("is_void || area < 0", "is_void || area > 0"),
        ("beside > 0 && std::isfinite(beside) && is_nested(contour, large)", "false"),
        ("if ((real && small == inner) || is_nested(contour, small)) drop(contour, small);", ""),
        ("beside < -kFoldArea", "beside < kFoldArea"),
        ("if (contains(contour, outer, contour[within].m[0])) drop_or_wait(within);", ""),
        ("area < beside ? small : large", "area < beside ? large : small"),
        ("!simple && encloses_solid(contour, component)", "false"),
    ),
    *_of(
        FREEFORM + "topology/components.hpp",
        ("winding == (loop.area > 0 ? 0 : 1)", "true"),
        ("winding >= 1", "winding >= 2"),
        ("points[k + 1].y > points[k].y ? 1 : -1", "points[k + 1].y > points[k].y ? -1 : 1"),
    ),
    *_of(
        FREEFORM + "refine.hpp",
        ("norm2(p[b] - p[a]) > limit", "norm2(p[b] - p[a]) > 1.44 * limit"),
        ("size < shortest && prune(contour, i)", "false"),
        ("0.5 * (start + end)", "0.8 * start + 0.2 * end"),
        ("dot(after, before) < 0", "false"),
        ("chords.longest <= kUneven * chords.shortest", "true"),
        ("polygon > kOscillation * size", "false"),
        ("kPruneRatio * contour.options.split_threshold", "1.2 * kPruneRatio * contour.options.split_threshold"),
        ("patch.wants_split && patch.budget > 0 && contour.splittable(i)", "false"),
    ),
    *_of(
        FREEFORM + "pool.hpp",
        (
            "second.m[k] = apply<D>(kBasis<D>.halves[D + k], points);",
            "second.m[k] = apply<D>(kBasis<D>.halves[D + k - 1], points);",
        ),
        (
            "for (int k = 1; k < D; ++k) patch.control[k] = apply<D>(kBasis<D>.inverse[k], points);",
            "for (int k = 1; k < D; ++k) patch.control[k] = points[k];",
        ),
    ),
    *_of(
        FREEFORM + "deform.hpp",
        (
            "reach(contour.field, motion.points[k], normal, contour.options.balloon, free)",
            "0.8 * reach(contour.field, motion.points[k], normal, contour.options.balloon, free)",
        ),
        ("k > 0 ? motion.tangent[k] : unit(motion.tangent[0] + prev.end_tangent)", "motion.tangent[k]"),
        ("0.25 * (motion.chord[k] - back)", "-0.25 * (motion.chord[k] - back)"),
        ("std::max(kCautiousStep, known)", "std::max(5.0, known)"),
        ("s < kSteady", "s < 8 * kSteady"),
        ("free + ahead < kBulge * motion.chord[k] + 2 * contour.options.balloon", "false"),
        ("if (field.blocked(from + ahead * normal)) break;", ""),
    ),
    *_of(
        FREEFORM + "guard.hpp",
        ("patch.m[at] = patch.before[at];", ""),
    ),
    *_of(
        FREEFORM + "topology/strips.hpp",
        ("static_cast<int>(top_[on] <= sides.bottom)", "static_cast<int>(top_[on] <= sides.top)"),
        ("!(left_[first] <= right_[at])", "!(left_[first] <= left_[at])"),
        ("moving ? at + 1 : next_moving_[at + 1]", "moving ? at + 2 : next_moving_[at + 1]"),
        ("left_[block] <= sides.right;", "left_[block] <= sides.left;"),
    ),
    *_of(
        FREEFORM + "field/field.cpp",
        ("here | (above & ((left & (up_left ^ kOnes)) | (right & (up_right ^ kOnes))))", "here"),
        ("if (left <= right && field::holds_solid(cells_, left, right, y, y)) return true;", ""),
    ),
    *_of(
        FREEFORM + "settling/settle.hpp",
        ("at_[i] + offset_[i] * normal_[i]", "at_[i] - offset_[i] * normal_[i]"),
        ("std::isnan(here) || std::abs(here - median) > kRidgeOutlier", "false"),
        ("std::abs(off) > kRidgeMiss", "false"),
        ("unfold();", ""),
        ("project(kRidgeAhead, -kRidgeBack, reach_);", "project(kRidgeAhead, -kRidgeBack, 0.5 * reach_);"),
        ("return ahead - kFine;", "return 0.0;"),
        (
            "lay_out<D>(at_, std::min(spacing, kSettledSpacing));",
            "lay_out<D>(at_, std::min(spacing, 4 * kSettledSpacing));",
        ),
    ),
    *_of(
        FREEFORM + "settling/ridge.hpp",
        ("s + kRidgeStep * 0.5 * (a - c) / bend", "s - kRidgeStep * 0.5 * (a - c) / bend"),
        ("if (b < low_) return std::numeric_limits<double>::quiet_NaN();", ""),
        ("if (s > most) return std::numeric_limits<double>::quiet_NaN();", ""),
    ),
    *_of(
        FREEFORM + "settling/untangle.hpp",
        ("for (const Place& place : crossings_.places()) smooth(place);", ""),
        ("divide(round == kDivideRound ? crossings_.loops() : obstacles);", ""),
        ("(kDrawBack / size)", "(-kDrawBack / size)"),
    ),
    *_of(
        FREEFORM + "evolution.cpp",
        ("if (options.topology) settling::Untangle<D>(settled_).run();", ""),
        ("if (contour_.options.topology) topology::drop_nested(contour_);", ""),
        ("contour_.counts.iterations >= next_fit_", "next_fit_ == 0"),
        ("(resting::wake_open(contour_) || wake_anew())", "resting::wake_open(contour_)"),
    ),
    *_of(
        FREEFORM + "resting/rest.hpp",
        ("(contour.pressure == nullptr || any_unstopped(contour, at, free))", "true"),
        ("contour.pressure == nullptr || !contour.pressure->stops_near(p)", "true"),
    ),
    *_of(
        FREEFORM + "resting/slide.hpp",
        ("dot(behind, ahead) < 0", "false"),
        ("along > kSideways", "along > 0"),
        ("(gets_on(to) || visit_beside(to, gets_on))", "gets_on(to)"),
        ("contour.memory.retried.count(contour.field.pixel(to)) != 0", "false"),
    ),
    *_of(
        "native/region/pressure.cpp",
        ("closes_in ? log_odds(other, one, weight_) : log_odds(one, other, weight_)", "log_odds(one, other, weight_)"),
        ("for (std::size_t i = 0; i < within.size(); ++i) outside[i] -= within[i];", ""),
        ("if (closes_in && count > 0) std::reverse(first + 1, first + count);", ""),
        ("if (one.count < kFewest || other.count < kFewest) return unless;", ""),
        ("rest.log_volume - swept.log_volume", "swept.log_volume - rest.log_volume"),
        ("ahead > kNearest ? std::max(0.5 * ahead, kNearest) : 0", "0"),
    ),
]  # fmt: skip

STRUCTURAL = [
    *_of(
        "freespace/structural.py",
        (" & (raised <= MOST_RAISED * (flat + raised))", ""),
        ("(flat >= LEAST_FLAT)", "(flat >= 0)"),
        ("(flat + votes.low >= LEAST_BOTH)", "(flat >= 0)"),
        (" & (raised == 0) &", " &", "two or three flat samples and one raised exceed MOST_RAISED"),
        (
            "large & votes.on_ground & doubt.known",
            "large & doubt.known",
            "a component that is not on the ground is not asked for samples, and none is too few",
        ),
        ("merged = large & votes", "merged = votes"),
        ("told = large & doubt.known & (votes.matched > 0)", "told = large & doubt.known"),
        ("told = large & doubt.known &", "told = large &"),
        ("sure = altitude + CONFIDENT * matches", "sure = altitude - CONFIDENT * matches"),
        ("owner[altitude >= epsilon]", "owner[altitude >= 1.2 * epsilon]"),
        ("high * LOW_PER_HIGH <= low", "high <= low"),
        ("(low > 0) & ", ""),
        ("\nLEAST_FLAT = 4", "\nLEAST_FLAT = 5"),
        ("\nLEAST_AREA = 30", "\nLEAST_AREA = 36"),
        ("MOST_RAISED = 0.2\n", "MOST_RAISED = 0.24\n"),
    ),
    *_of(
        "freespace/corners.py",
        ("good = unique & stayed & ", "good = unique & "),
        ("good = unique & stayed", "good = stayed"),
        (" & (aligned.score > LEAST_SCORE)", ""),
        (" & (miss < REPROJECTION_GATE)", ""),
        (" & (near > 0)", ""),
        ("near = nearness + along", "near = nearness - along"),
    ),
    *_of(
        "freespace/outlines.py",
        ("flat & tells, raised & tells", "flat, raised"),
        (" | (miss > MISS_GATE)", ""),
        ("raised = ~similar | ", "raised = "),
        ("(np.abs(altitude) - CONFIDENT * sigma > 1.0)", "(np.abs(altitude) - CONFIDENT * sigma > 1.2)"),
        ("(np.abs(altitude) + CONFIDENT * sigma < 1.0)", "(np.abs(altitude) < 1.0)"),
        ("ground.pixels[:, 0] - moved", "ground.pixels[:, 0] + moved"),
    ),
]
MOTION = [
    *_of(
        "camera/motion.py",
        ("previous.rotation.T @ current.rotation", "current.rotation.T @ previous.rotation"),
        ("(current.position - previous.position)", "(previous.position - current.position)"),
        ("_turn(theta) @ camera.level(), np", "_turn(-theta) @ camera.level(), np"),
        ("rotation[1, 0] - rotation[0, 1]", "rotation[0, 1] - rotation[1, 0]"),
        ("rotation = level.T @ _turn(planar[2]) @ level", "rotation = level.T @ _turn(-planar[2]) @ level"),
        ("motion.translation + moves @", "motion.translation - moves @"),
        (" + bend[:, None, None] * (cross @ cross)", ""),
        ("(camera.lift(pixels)) @ camera.level().T", "(camera.lift(pixels)) @ camera.level()"),
    ),
    *_of(
        "freespace/motion/ground.py",
        ("np.swapaxes(root, 1, 2) @ slopes", "slopes"),
        ('np.einsum("nji,nj->ni", root, tracks.previous', 'np.einsum("nij,nj->ni", root, tracks.previous'),
        ("np.minimum(square, GATE**2)", "square"),
        ("\nGATE = 3.5", "\nGATE = 4.2"),
        ("\nMIN_INLIERS = 8", "\nMIN_INLIERS = 10"),
        ("np.random.default_rng(0)", "np.random.default_rng()"),
        ("whole - (mine @ normals)", "whole - 0.0 * (mine @ normals)"),
        ("-(inverses @ pulls[..., None])", "(inverses @ pulls[..., None])"),
        ("(squares.sum() - mine @ squares[owned])", "squares.sum()"),
        ("2.0 * (len(white) - own) - 5.0", "2.0 * len(white) - 5.0"),
        ("(len(owner) - own >= MIN_INLIERS)", "(len(owner) >= MIN_INLIERS)"),
        ("_normal(levers) + self.hold", "_normal(levers)"),
    ),
]
