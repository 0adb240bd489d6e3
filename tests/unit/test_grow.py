"""What the forests that come with ffseg are grown from: drawings, the same every time, and which kinds are left out together."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from ffseg.evidence import base, hints, prior
from ffseg.evidence.forest import load_model, to_bytes
from ffseg.learning import grow as growing
from ffseg.learning.drawn.sights import KINDS, MIN_DEPTH, sights
from ffseg.learning.grow import CLICKED_VIEWS, VIEWS_PER_KIND, grow, hint_samples, prior_samples
from ffseg.metrics import INSIDE
from tests.campaigns.left_out import GROUPS, changed, judged

FLAT = [name for name, kind in KINDS.items() if not kind.alike]
"""Kinds that are painted, not ray cast: quick to draw."""


@pytest.mark.parametrize(
    ("path", "names", "looks"),
    [
        (prior.MODEL, prior.FEATURE_NAMES, VIEWS_PER_KIND),
        (base.BASE, None, VIEWS_PER_KIND),
        (hints.MODEL, hints.FEATURE_NAMES, 2 * CLICKED_VIEWS),
    ],
)
def test_the_models_that_ship_say_what_they_are_of(path: object, names: object, looks: int) -> None:
    about = load_model(path, *([names] if names else [])).about
    assert about.keys() == {"drawn", "photographs", "versions", "fingerprint"}
    assert about["drawn"] == {"looks": looks, "kinds": list(KINDS)}
    assert about["photographs"] == 0


def test_the_models_that_ship_are_of_this_code() -> None:
    """Whoever changes what a forest sees or learns from grows all of them again."""
    command = [sys.executable, "-m", "ffseg.learning.grow", "--check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode == 2:
        pytest.skip(done.stdout)
    assert (done.returncode, done.stdout) == (0, "all forests are of this code\n"), done.stderr


@pytest.mark.parametrize("name", FLAT)
def test_a_look_shows_its_start_inside_the_truth(name: str) -> None:
    least, most = KINDS[name].shares
    for seen in sights(name, 2):
        inside = seen.truth == INSIDE
        assert inside[seen.disc()].all()
        assert seen.disc().sum() >= np.pi * (0.8 * (MIN_DEPTH - 2)) ** 2 / 2
        assert least < inside.mean() < most


def test_a_look_does_not_depend_on_how_many_there_are() -> None:
    few, more = list(sights("nuclei", 1)), list(sights("nuclei", 3))
    assert np.array_equal(few[0].image, more[0].image)
    assert few[0].start == more[0].start


def test_the_same_looks_grow_the_same_bytes() -> None:
    made = [
        to_bytes(grow([look[0][0] for look in prior_samples("tissue", 2)], prior.FEATURE_NAMES, {})) for _ in range(2)
    ]
    assert made[0] == made[1]


def test_a_forest_is_judged_by_what_it_finds() -> None:
    forest = load_model(prior.MODEL, prior.FEATURE_NAMES).inside
    assert [overlap > 0.5 for _, overlap in judged("organ", forest, 2)] == [True, True]
    assert [overlap for _, overlap in judged("organ", replace(forest, bias=-100), 2)] == [0, 0]


def test_the_same_clicks_grow_the_same_bytes() -> None:
    made = [to_bytes(grow(hint_samples("nuclei", 1, 0, prior.MODEL.parent), hints.FEATURE_NAMES, {})) for _ in range(2)]
    assert made[0] == made[1]


def test_clicks_correct_what_a_model_says(monkeypatch: pytest.MonkeyPatch) -> None:
    """The clicks' forest learns beside models, too, what it is asked beside: with their answers in the place of the prior's."""
    seen, place = next(iter(sights("nuclei", 1))), hints.FEATURE_NAMES.index("prior")
    model = load_model(base.BASE)
    monkeypatch.setattr(growing, "_answer", lambda *_: np.full(seen.truth.shape, 1.25, np.float32))
    for one, answers in ((None, False), (model, True)):
        looks = growing.for_clicks(seen, np.random.default_rng(0), one)
        assert looks
        assert all(({*look.rows[:, place].tolist()} == {1.25}) == answers for look in looks)


def test_each_kind_of_a_group_is_drawn_and_left_out_once() -> None:
    names = [kind for group in GROUPS for kind in group]
    assert len(names) == len(set(names))
    assert set(names) <= set(KINDS)


def test_two_looks_at_one_picture_count_as_one() -> None:
    before = {("room", 0): 0.5, ("room", 1): 0.5, ("room", 2): 0.5, ("street", 0): 0.5}
    now = {("room", 0): 0.6, ("room", 1): 0.8, ("room", 2): 0.4, ("field", 0): 0.0}
    # changes .2 and -.1 of two pictures: mean .05, deviation .15, over the root of two
    assert changed(now, before) == "changed by +0.0500, standard error 0.1061, 2 pictures"
