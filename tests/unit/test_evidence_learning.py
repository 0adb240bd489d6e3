"""Learning from masks: samples, trees as LightGBM grows them, models that find what they were shown."""

from dataclasses import replace

import numpy as np
import pytest

from ffseg.errors import UsageError
from ffseg.evidence.base import base, odds_of
from ffseg.evidence.features import ALL_FEATURES, features
from ffseg.evidence.forest import Model
from ffseg.evidence.growing import converted
from ffseg.evidence.source import model_odds
from ffseg.image.appearance import Appearance
from ffseg.learning import training
from ffseg.learning.examples import (
    CLICKS,
    PIXELS,
    STARTS,
    Example,
    known_of_some,
    known_pixels,
    mirrored,
    samples,
    starts_in,
)
from ffseg.learning.learn import uncertainty
from ffseg.learning.training import (
    CORRECTION_FRACTION,
    PRIOR_WEIGHT,
    STARTLESS_FEATURES,
    TREES,
    SampleSet,
    grow,
    learn,
)
from ffseg.metrics import iou
from tests.discs import disc_of
from tests.stumps import probabilities

lightgbm = pytest.importorskip("lightgbm")
SHAPE = (80, 120)
disc = disc_of(SHAPE)


def example(seed: int, *, start: bool = True) -> Example:
    """A greenish disc among bluish ones of the same brightness, on noise."""
    rng = np.random.default_rng(seed)
    image = rng.normal(110, 6, (*SHAPE, 3))
    x, y = rng.uniform(35, 85), rng.uniform(30, 50)
    inside = disc(x, y, 24)
    image[disc(x + 40, y, 14)] += (40, 0, -20)
    image[inside] += (-30, 20, 0)
    truth = np.where(inside, np.uint8(255), np.uint8(0))
    return Example(np.clip(image, 0, 255).astype(np.uint8), truth, disc(x, y, 6) if start else None, 6.0)


def predicted(model: Model, one: Example) -> np.ndarray:
    return model_odds(model, model.appearance(one.image), one.start)


def test_two_masks_teach_what_is_inside() -> None:
    model = learn(SampleSet([samples(example(seed)) for seed in (1, 2)]))
    for seed in (3, 4, 5):
        assert iou(predicted(model, example(seed)) > 0.5, example(seed).truth) > 0.9


def test_the_second_forest_needs_no_start() -> None:
    model = learn(SampleSet([samples(example(seed)) for seed in (1, 2)]))
    one = example(3)
    anywhere = features(model.appearance(one.image), disc(5, 5, 3))
    assert iou(probabilities(model.start, anywhere) > 0.5, one.truth) > 0.8
    assert not [
        name for name in STARTLESS_FEATURES if name.startswith(("from_", "barrier", "way", "across", "likeness"))
    ]


def test_scribbles_are_enough() -> None:
    """All but two strips of the masks is unknown."""
    partial = []
    for seed in (1, 2, 3):
        one = example(seed)
        truth = np.full(SHAPE, 128, np.uint8)
        rows = np.flatnonzero((one.truth == 255).any(1))
        for row in rows[len(rows) // 3 :: len(rows) // 3][:2]:
            truth[row - 1 : row + 2] = one.truth[row - 1 : row + 2]
        partial.append(samples(Example(one.image, truth, one.start, 3.0)))
    assert iou(predicted(learn(SampleSet(partial)), example(4)) > 0.5, example(4).truth) > 0.8


def test_scribbles_of_one_pixel_are_enough_on_images_that_are_reduced() -> None:
    partial = []
    for seed in (1, 2, 3):
        one = example(seed)
        image, whole, start = (plane.repeat(8, axis=0).repeat(8, axis=1) for plane in (one.image, one.truth, one.start))
        truth = np.full(whole.shape, 128, np.uint8)
        for row in np.flatnonzero((whole == 255).any(1))[40::120]:
            truth[row] = whole[row]
        partial.append(samples(Example(image, truth, start, 24.0)))
    assert iou(predicted(learn(SampleSet(partial)), example(4)) > 0.5, example(4).truth) > 0.8


def test_converted_trees_say_what_lightgbm_says() -> None:
    one = samples(example(1))
    data = lightgbm.Dataset(one.rows, one.inside.astype(np.float32))
    settings = {"objective": "binary", "num_leaves": 31, "verbose": -1, "use_missing": False, "num_threads": 1}
    booster = lightgbm.train(settings, data, 20)
    forest = converted(booster.dump_model()["tree_info"], ALL_FEATURES)
    seen = features(Appearance(example(2).image), example(2).start)
    wanted = booster.predict(seen.of_pixels(ALL_FEATURES, np.arange(example(2).truth.size)))
    np.testing.assert_allclose(probabilities(forest, seen).ravel(), wanted, atol=2e-6)  # 20 leaves in single precision


def test_the_same_masks_give_the_same_forest() -> None:
    chosen = SampleSet([samples(example(seed)) for seed in (1, 2)])
    one, two = grow(chosen, trees=5), grow(chosen, trees=5)
    for name, array in one.arrays.items():
        np.testing.assert_array_equal(array, two.arrays[name])


def test_samples_are_known_pixels_seen_twice() -> None:
    one = samples(example(1))
    assert one.rows.shape == (2 * PIXELS, len(ALL_FEATURES))
    assert 0.02 < one.inside.mean() < 0.5
    half = PIXELS // 5
    np.testing.assert_array_equal(mirrored(one.rows[:half]), one.rows[half : 2 * half])
    np.testing.assert_allclose(mirrored(mirrored(one.rows)), one.rows, atol=1e-6)


@pytest.mark.parametrize("radius", [6.0, 60.0])
def test_drawn_starts_lie_inside_the_mask(radius: float) -> None:
    one = example(1, start=False)
    drawn = starts_in(Example(one.image, one.truth, None, radius), np.random.default_rng(0))
    assert len(drawn) == 5
    assert all((one.truth[start] == 255).all() and start.any() for start in drawn)


def test_the_last_starts_are_as_small_as_clicks() -> None:
    one = example(1, start=False)
    areas = [
        int(start.sum()) for start in starts_in(Example(one.image, one.truth, None, 6.0), np.random.default_rng(0))
    ]
    assert len(areas) == STARTS
    assert max(areas[-CLICKS:]) < min(areas[:-CLICKS])


def test_mixed_and_unknown_pixels_are_no_samples() -> None:
    truth = np.zeros((4, 6), np.uint8)
    truth[:, :3], truth[0, 5] = 255, 128
    assert known_pixels(truth, 2).tolist() == [[1, -1, -1], [1, -1, 0]]
    truth[:, 3:] = 128
    truth[3, 5] = 0
    assert known_of_some(truth, 2).tolist() == [[1, 1, -1], [1, 1, 0]]


def test_what_is_too_small_to_be_seen_is_not_said_to_be_missing() -> None:
    image, truth = np.zeros((90, 1600), np.uint8), np.zeros((90, 1600), np.uint8)
    truth[40:43, 801] = 255
    said = "knows inside is too small or thin: the image is seen at 400 pixels a side; cut it out"
    with pytest.raises(UsageError, match=said):
        samples(Example(image, truth, None, 4.0))


def test_uncertainty_is_higher_on_what_was_never_seen_and_hears_the_prior() -> None:
    model = learn(SampleSet([samples(example(seed)) for seed in (1, 2)]))
    one = example(3)
    odd = model.appearance(np.random.default_rng(0).integers(0, 255, one.image.shape, np.uint8))
    image = model.appearance(one.image)
    assert uncertainty(model, odd, one.start) > uncertainty(model, image, one.start)
    sure = replace(model, prior=9.0)
    assert uncertainty(sure, image, one.start) < uncertainty(replace(model, prior=0.0), image, one.start)


def test_one_mask_corrects_the_base() -> None:
    one = learn(SampleSet([samples(example(1))]), searched=False)
    trees = len(base().arrays["root"]) + round(CORRECTION_FRACTION * TREES)
    assert (len(one.inside.arrays["root"]), one.prior) == (trees, PRIOR_WEIGHT)
    assert iou(predicted(one, example(2)) > 0.5, example(2).truth) > 0.8


def test_of_many_masks_ten_parts_are_left_out_of_as_many_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each was left out alone, in each part that is left out to measure: time went with the square of their number."""
    chosen, grown_from = SampleSet([samples(example(seed)) for seed in range(12)]), []
    plain = training.grow

    def counted(some: SampleSet, **others: object) -> object:
        grown_from.append((len(some), sum(map(len, some.inside))))
        return plain(some, **others)

    monkeypatch.setattr(training, "grow", counted)
    assert training._left_out_overlap(chosen, corrected=False) > 0.9
    assert [count for count, _ in grown_from] == [10] * 2 + [11] * 8
    pixels = [len(one[:: 2 * training.SUBSAMPLING]) for one in chosen.inside]
    assert grown_from[0][1] == sum(pixels) - pixels[0] - pixels[10]


def test_a_forest_of_images_that_are_left_twice_is_grown_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the first and the second, as without the second and the first."""
    chosen, grown_from = SampleSet([samples(example(seed)) for seed in range(4)]), []
    plain = training.grow
    monkeypatch.setattr(training, "grow", lambda some, **how: grown_from.append(some.numbers) or plain(some, **how))
    for others, _ in chosen.left_out():
        training._left_out_overlap(others, corrected=False)
    assert grown_from == [(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)]


def test_a_forest_of_some_images_is_that_of_these_alone() -> None:
    """The bins are those of all, and know no label: of images alike both see the same."""
    chosen = [samples(example(seed)) for seed in (1, 2, 3)]
    some, alone = grow(SampleSet(chosen).some([2, 0])), grow(SampleSet([chosen[0], chosen[2]]))
    for one in chosen:
        assert np.mean((odds_of(some, one.rows) > 0) == (odds_of(alone, one.rows) > 0)) > 0.99
    swapped = [replace(one, inside=~one.inside) for one in chosen[1:2]]
    some_again = grow(SampleSet([chosen[0], *swapped, chosen[2]]).some([0, 2]))
    assert all(np.array_equal(array, some_again.arrays[name]) for name, array in some.arrays.items())
