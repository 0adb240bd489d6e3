"""Floors of every kind: what is drawn, and a short form of the campaign on them."""

from dataclasses import replace

import numpy as np
import pytest
from rendered import floor_pair

from ffseg.parameter_files import load_params
from ffseg.rendering.raycast import SHADOW, STREAK, tilt_matrix
from tests.campaigns.freespace import LEAST_IOU, MOST_SHIFTED, Case, Tally, cases, enclosed_marks, kept, run
from tests.floors import FLOOR_KINDS

SHORT = (
    Case(30, "drawn"),
    Case(100_001, "plain", 0.0, 4.0),
    Case(100_002, "nodding", 0.0, 2.0),
    Case(100_003, "turning", 1.0, 1.0),
)


@pytest.mark.parametrize("case", SHORT, ids=lambda case: case.kind)
def test_short_campaign_on_floors(case: Case) -> None:
    tallies = run(iter([case]), load_params())
    for (_, mode), tally in tallies.items():
        assert tally.boxes_merged == 0, (mode, tally.misses)
        assert tally.marks_merged == tally.marks > 0, (mode, tally.misses)
        assert np.mean(tally.ious) >= LEAST_IOU
        assert case.kind != "drawn" or max(tally.shift_errors) <= MOST_SHIFTED


def test_textures_and_noises_are_what_they_are_called() -> None:
    bare = floor_pair(7, "plain", 0.0, 2.0).current
    ground = (bare.labels == 0) & np.roll(bare.labels == 0, 3, 0) & np.roll(bare.labels == 0, -3, 1)
    inner = ground & (np.roll(ground, 6, 0) & np.roll(ground, -6, 0) & np.roll(ground, 6, 1) & np.roll(ground, -6, 1))
    assert bare.image[inner].std() == pytest.approx(np.sqrt(4.0 + 1.0 / 12.0), rel=0.02)  # noise and rounding
    rough = floor_pair(7, "plain", 5.0, 1.0).current.image[inner].astype(float)
    # The longest wave is half a metre: a scene holds some fifty of them, and the finest fade with the distance.
    assert 3.5 < rough.std() < 5.5


def test_a_streak_moves_with_the_camera_and_shadows_do_not() -> None:
    glossy = floor_pair(8, "glossy", 2.0, 1.0)
    turn = glossy.poses[0][2] - glossy.poses[1][2]
    middles = []
    for view in (glossy.previous, glossy.current):
        rows, columns = np.nonzero(view.labels == STREAK)
        middles.append(complex(columns.mean() - 399.5, rows.mean() - 299.5))
    # What hides the strip in part, a pixel's rounding and the mirror's curvature move the middle by some pixels.
    assert middles[0] * np.exp(1j * turn) == pytest.approx(middles[1], abs=8.0)
    assert (floor_pair(8, "shadows", 2.0, 1.0).current.labels == SHADOW).any()


def test_a_tilted_view_is_the_level_one_turned() -> None:
    pair = floor_pair(9, "nodding", 3.0, 1.0)
    camera, (x, y, theta) = pair.camera, pair.poses[1]
    c, s = np.cos(theta), np.sin(theta)
    for index, mark in enumerate(pair.scene.marks):
        away = mark.outline.mean(axis=0) - [x, y]
        level = np.array([c * away[0] + s * away[1], -s * away[0] + c * away[1], camera.mounting()])
        u, v = camera.project((tilt_matrix(*pair.tilts[1]).T @ level)[None])[0]
        assert pair.current.labels[round(v), round(u)] == 1 + index


def test_cases_are_apart_and_marks_that_touch_count_as_enclosed() -> None:
    every = list(cases(15, FLOOR_KINDS))
    assert len({case.seed for case in every}) == len(every) == 15 * (5 + 7)
    assert {(case.texture, case.noise) for case in every if case.kind == "glossy"} == {
        (texture, noise) for texture in (0.0, 1.0, 2.0, 3.0, 5.0) for noise in (1.0, 2.0, 4.0)
    }
    assert len(enclosed_marks(floor_pair(100_004, "touching", 2.0, 4.0))) >= 4


def test_the_campaign_fails_on_a_merged_box_or_a_mark_that_stays() -> None:
    good = Tally(boxes=3, marks=20, marks_merged=19, ious=[0.99])
    assert kept({("a", "poses"): good})
    for change in ({"boxes_merged": 1}, {"marks_merged": 18}, {"ious": [0.98]}):
        bad = replace(good, **change)
        assert not kept({("a", "poses"): good, ("b", "noisy"): bad})
