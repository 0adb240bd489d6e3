"""Models that ask the prior too: where, what is added, and what their file remembers."""

from dataclasses import replace

import numpy as np
import pytest

from ffseg.cli.commands.learn import prior_sentence
from ffseg.evidence.features import ALL_FEATURES, features
from ffseg.evidence.forest import Forest, Model, from_bytes, to_bytes
from ffseg.evidence.prior import prior
from ffseg.evidence.source import model_odds
from ffseg.image.appearance import Appearance
from ffseg.learning.examples import Samples, samples
from ffseg.learning.training import SUBSAMPLING, PriorChoice, SampleSet, choose_prior, learn
from tests.stumps import stump
from tests.unit.test_evidence_base import halves
from tests.unit.test_evidence_learning import example


def sampled(share: float) -> Samples:
    """Pixels on which the prior has an IoU of `share`."""
    odds, inside = halves(share)
    return Samples(np.zeros((len(inside), len(ALL_FEATURES)), np.float32), inside, odds)


@pytest.mark.parametrize("share", [0.8, 0.3])
def test_one_mask_asks_the_prior(share: float) -> None:
    """It did so where the prior knew three quarters of it, and was worse than no model on all but road frames."""
    decided = choose_prior(SampleSet([sampled(share)]))
    assert (decided.asked, decided.taught) == (True, None)
    assert decided.prior == pytest.approx(share)


@pytest.mark.parametrize(("share", "taught", "found"), [(0.9, 0.95, False), (0.6, 0.55, True), (0.6, 0.65, False)])
@pytest.mark.parametrize("count", [2, 3, 5, 8])
def test_more_masks_ask_it_where_it_adds_to_what_they_teach_each_other(
    count: int, share: float, taught: float, found: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However well it does by itself; here it is surer than they are, and both together are what it is."""
    told = halves(taught)[0][::SUBSAMPLING] / 2
    monkeypatch.setattr("ffseg.learning.training.odds_of", lambda *_: told)
    monkeypatch.setattr("ffseg.learning.training.SampleSet.small_forest", lambda _, corrected: None)
    chosen = [sampled(share)] * count
    decided = choose_prior(SampleSet(chosen))
    assert decided.asked is found
    assert (decided.taught, decided.both) == (pytest.approx(taught, abs=0.01), pytest.approx(share, abs=0.01))
    assert choose_prior(SampleSet([*chosen, Samples(chosen[0].rows, chosen[0].inside)])) is None


def test_a_model_adds_the_log_odds_of_the_prior() -> None:
    one, image = example(1), Appearance(example(1).image)
    even = Forest({**stump("x", 0.5).arrays, "value": np.ones(2, np.float32)}, bias=0.25)
    alone, both = (Model(even, exposed=True, prior=weight) for weight in (0.0, 0.5))
    np.testing.assert_allclose(model_odds(alone, image, one.start), 1 / (1 + np.exp(-1.25)), rtol=1e-6)
    sums = 1.25 + 0.5 * prior(image, one.start)
    np.testing.assert_allclose(
        model_odds(both, image, one.start), 1 / (1 + np.exp(-sums)), rtol=1e-5
    )  # single precision
    with pytest.raises(ValueError, match="asks the prior"):
        both.map(features(image, one.start))


def test_the_file_remembers_the_prior() -> None:
    asks, own = Model(stump("x", 0.5), prior=0.75), Model(stump("x", 0.5))
    assert (from_bytes(to_bytes(asks)).prior, from_bytes(to_bytes(own)).prior) == (0.75, 0.0)
    assert b"prior" not in to_bytes(own)


@pytest.mark.parametrize("sign", [1, -1])
def test_learning_decides_and_says_so(sign: int) -> None:
    pytest.importorskip("lightgbm")
    chosen = [samples(example(seed)) for seed in (1, 2)]
    assert all(one.prior is not None and one.prior.shape == one.inside.shape for one in chosen)
    told = [replace(one, prior=sign * np.where(one.inside, 9, -9)) for one in chosen]
    model = learn(SampleSet(told), searched=False)
    assert model.prior == (sign > 0)
    said = model.about["prior"]
    assert said["asked"] is (said["both"] > said["taught"]) is (sign > 0)
    assert f"the masks teach each other {said['taught']:.2f}, {said['both']:.2f} with it" in prior_sentence(
        PriorChoice(**said)
    )


def test_samples_hold_the_odds_of_their_own_pixels() -> None:
    """Of the start and the place of each: pixels inside are told from others as the prior tells them."""
    one = samples(example(1))
    overlap = np.count_nonzero((one.prior >= 0) & one.inside) / np.count_nonzero((one.prior >= 0) | one.inside)
    assert overlap > 0.8


def test_what_is_said_of_one_mask() -> None:
    said = prior_sentence(PriorChoice(True, 0.8))
    assert said == "asks the prior that comes with ffseg too: one mask is too little without it"
