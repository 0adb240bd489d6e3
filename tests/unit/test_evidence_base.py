"""The forest that masks correct: when it is taken, what is added to it, and what a model remembers of how it looks."""

import numpy as np
import pytest

from ffseg.evidence.base import base, enough_of, joined, odds_of
from ffseg.evidence.features import ALL_FEATURES, features
from ffseg.evidence.forest import MAGIC, Model, from_bytes, to_bytes
from ffseg.image.appearance import Appearance, normalised_exposure
from ffseg.learning.examples import Samples, samples
from ffseg.learning.training import TREES, SampleSet, _left_out_overlap, choose_base, grow, learn
from ffseg.metrics import iou
from tests.stumps import probabilities, stump
from tests.unit.test_evidence_learning import example, predicted


def halves(share: float) -> tuple[np.ndarray, np.ndarray]:
    """Odds and truth of pixels whose IoU is `share`."""
    inside = np.ones(1000, np.bool_)
    return np.where(np.arange(1000) < 1000 * share, np.float32(1), np.float32(-1)), inside


def test_rows_get_the_odds_that_planes_get() -> None:
    one = example(1)
    seen = features(Appearance(one.image), one.start)
    rows = seen.of_pixels(ALL_FEATURES, np.arange(1501))
    probability = probabilities(base(), seen).ravel()[:1501]
    # the same sums; only the logarithm of a rounded probability differs
    np.testing.assert_allclose(1 / (1 + np.exp(-odds_of(base(), rows))), probability, atol=1e-6)


def test_the_base_sees_no_place() -> None:
    assert {"x", "y", "across", "along"}.isdisjoint(base().features)


def test_joined_forests_add_their_odds() -> None:
    one, other = stump("light@0.7", 50.0), stump("y", 0.5)
    rows = np.zeros((4, len(ALL_FEATURES)), np.float32)
    rows[:, ALL_FEATURES.index("light@0.7")] = [0, 100, 0, 100]
    rows[:, ALL_FEATURES.index("y")] = [0, 0, 1, 1]
    assert odds_of(joined(one, other), rows).tolist() == [-3.5, 0.5, 0.5, 4.5]
    assert odds_of(joined(joined(one, other), other), rows).tolist() == [-5.25, -1.25, 2.75, 6.75]


@pytest.mark.parametrize(("count", "share", "ok"), [(1, 0.7, False), (1, 0.8, True), (5, 0.55, False), (5, 0.65, True)])
def test_few_masks_must_show_more(count: int, share: float, ok: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    odds, inside = zip(*(halves(share) for _ in range(count)), strict=True)
    chosen = [Samples(np.zeros((len(one), len(ALL_FEATURES)), np.float32), one) for one in inside]
    monkeypatch.setattr("ffseg.learning.training._left_out_overlap", lambda *_, **__: 1.0)
    found = choose_base(SampleSet(chosen), odds)
    assert found.corrected is (ok or count == 1)  # one mask is too little to begin with
    assert (found.base, found.enough) == (pytest.approx(share, abs=0.001), enough_of(count))  # of 1000 pixels
    assert found.taught == (None if ok or count == 1 else 1.0)


def test_masks_correct_a_base_that_serves_them(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("lightgbm")
    own = stump("likeness", 0.0)
    monkeypatch.setattr("ffseg.learning.training.base", lambda: own)
    monkeypatch.setattr("ffseg.learning.training.enough_of", lambda _: 0.0)
    chosen = SampleSet([samples(example(seed)) for seed in (1, 2)])
    model = learn(chosen, searched=False)
    more = grow(chosen, trees=40, begin=[odds_of(own, one.rows) for one in chosen.images])
    for one in chosen.images:
        total = odds_of(own, one.rows) + odds_of(more, one.rows)
        np.testing.assert_allclose(odds_of(model.inside, one.rows), total, atol=1e-4)  # sums in another order
    assert iou(predicted(model, example(3)) > 0.5, example(3).truth) > 0.9
    monkeypatch.setattr("ffseg.learning.training.enough_of", lambda _: 2.0)
    monkeypatch.setattr("ffseg.learning.training._left_out_overlap", lambda *_, **__: 1.0)
    assert len(learn(chosen, searched=False).inside.arrays["root"]) == TREES


def test_masks_teach_each_other_unless_they_contradict() -> None:
    pytest.importorskip("lightgbm")
    one, two = (samples(example(seed)) for seed in (1, 2))
    assert _left_out_overlap(SampleSet([one, two]), corrected=False) > 0.8
    assert _left_out_overlap(SampleSet([one, Samples(two.rows, ~two.inside)]), corrected=False) < 0.2


@pytest.mark.parametrize(("taught", "corrected"), [(0.0, True), (1.0, False)])
def test_a_base_is_mended_by_better_masks(taught: float, corrected: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("lightgbm")
    monkeypatch.setattr("ffseg.learning.training.enough_of", lambda _: 2.0)
    monkeypatch.setattr("ffseg.learning.training._left_out_overlap", lambda *_, **__: taught)
    model = learn(SampleSet([samples(example(seed)) for seed in (1, 2)]), searched=False)
    assert (len(model.inside.arrays["root"]) > len(base().arrays["root"])) is corrected
    told = from_bytes(to_bytes(model)).about["base"]
    assert (told["corrected"], told["enough"], told["taught"]) == (corrected, 2.0, taught)
    assert 0 < told["base"] < 1


def test_a_model_remembers_how_it_looks_at_images() -> None:
    one = example(1)
    plain, told = Model(stump("likeness", 0.0)), Model(stump("likeness", 0.0), exposed=True)
    assert from_bytes(to_bytes(told)).exposed
    assert not from_bytes(to_bytes(plain)).exposed
    assert b"exposed" not in to_bytes(plain)[: len(MAGIC) + 200]
    dark = (one.image // 4).astype(np.uint8)
    seen, even, as_it_is = (
        features(model.appearance(image), one.start)["light@1.5"]
        for model, image in ((told, dark), (plain, normalised_exposure(dark)), (plain, dark))
    )
    np.testing.assert_array_equal(seen, even)
    assert not np.array_equal(seen, as_it_is)


def test_neighbours_outvote_specks_but_not_across_edges() -> None:
    rows, columns = np.indices(example(1).truth.shape)
    image = np.where(columns < 60, np.uint8(90), np.uint8(170))
    image[39:42, 29:32] = 96  # a speck
    start = np.hypot(rows - 20, columns - 20) < 6
    model = Model(stump("light@0.7", 39.0))
    seen = features(model.appearance(image), start)
    assert probabilities(model.inside, seen)[40, 30] > 0.5  # what the forest itself says of the speck
    found = model.map(seen) > 0.5
    assert not found[:, :58].any()
    assert found[:, 62:].all()
