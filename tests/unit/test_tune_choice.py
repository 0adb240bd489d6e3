"""Which setting ``ffseg tune`` takes for what a few masks say: levels by their hill, others beyond the noise."""

from collections.abc import Callable

import pytest

from ffseg.evidence.maps import log_odds
from ffseg.learning.choice import MIN_GAIN, MIN_SPREAD, MIN_STANDARD_ERRORS, Trial, Trials
from ffseg.learning.space import LEVEL, levels
from ffseg.parameter_files import load_params

PLAIN = (0.5, 0.4, 0.6)


def tried(gain: Callable[[float, int], float], others: tuple[Trial, ...] = ()) -> Trials:
    """Levels whose gain on an image is a function of how far they are moved, in log odds."""
    moved = []
    for setting in levels(load_params()):
        far = log_odds(float(str(setting[LEVEL])))
        moved.append(Trial(setting, {number: own + gain(far, number) for number, own in enumerate(PLAIN)}))
    return Trials(Trial({}, dict(enumerate(PLAIN))), 0.5, moved, others)


def other(*gains: float) -> Trial:
    """A setting without levels that gains so much on each image."""
    found = [own + gain for own, gain in zip(PLAIN, gains, strict=True)]
    return Trial({"edges.sigma": 2.2}, dict(enumerate(found)))


def hill(top: float, height: float, noise: float = 0.0) -> Callable[[float, int], float]:
    """Gains that rise to a top and fall beyond; images differ by `noise` for each unit."""
    return lambda far, number: height * (1 - (far / top - 1) ** 2) + noise * far * (number - 1)


def worse(far: float, _number: int) -> float:
    return -abs(far)


@pytest.mark.parametrize(("top", "level"), [(0.5, 0.62), (1.0, 0.73), (1.5, 0.82)])
def test_the_level_on_top_of_the_hill_is_taken(top: float, level: float) -> None:
    found = tried(hill(top, 0.1))
    assert found.chosen([0, 1, 2]).setting == {LEVEL: level}
    assert found.left_out() == tuple(found.chosen([0, 1, 2]).found.values())


def test_a_gain_of_no_level_is_above_its_noise() -> None:
    assert tried(hill(1.0, 0.02, noise=0.1)).chosen([0, 1, 2]).setting == {}
    assert tried(hill(1.0, 0.02)).chosen([0, 1, 2]).setting != {}


def test_levels_that_change_nothing_are_left_alone() -> None:
    assert tried(lambda _far, _number: 0.0).chosen([0, 1, 2]).setting == {}
    least = 0.9 * MIN_GAIN  # for each unit: not worth it
    assert tried(lambda far, _number: least * far).chosen([0, 1, 2]).setting == {}
    assert tried(lambda far, _number: 3 * least * far).chosen([0, 1, 2]).setting != {}


def test_lower_levels_must_be_better_by_a_handicap() -> None:
    assert tried(hill(-1.0, 0.08)).chosen([0, 1, 2]).setting == {}
    assert tried(hill(-1.0, 0.25)).chosen([0, 1, 2]).setting == {LEVEL: 0.27}


def test_a_sharp_top_of_few_images_counts_as_its_neighbours_do() -> None:
    """A hill round 1, and a peak at 2 that few images have by chance."""
    found = tried(lambda far, _number: hill(1.0, 0.1)(far, 0) if far < 1.8 else 0.101)
    assert found.chosen([0, 1, 2]).setting == {LEVEL: 0.73}


ENOUGH = MIN_STANDARD_ERRORS * MIN_SPREAD / 3**0.5
"""The gain that three images must show which agree."""


BETTER = [(ENOUGH + 0.01,) * 3, (0.4, 0.3, 0.2)]
NO_BETTER = [(ENOUGH - 0.01,) * 3, (0.5, -0.1, -0.1), (0.5, 0.1, 0.1)]


@pytest.mark.parametrize("gains", [*BETTER, *NO_BETTER])
def test_another_setting_must_be_better_than_the_noise(gains: tuple[float, ...]) -> None:
    found = tried(worse, (other(*gains),))
    assert (found.chosen([0, 1, 2]) is found.others[0]) is (gains in BETTER)


def test_the_noise_is_that_of_all_good_settings() -> None:
    """One that agrees with three images by chance, among others as good in the mean, whose gains lie far apart."""
    agreeing, apart = other(0.2, 0.2, 0.2), [other(0.2 + far, 0.2 - far, 0.15) for far in (0.4, 0.5, 0.6)]
    assert tried(worse, (agreeing,)).chosen([0, 1, 2]) is agreeing
    assert tried(worse, (agreeing, *apart)).chosen([0, 1, 2]).setting == {}


def test_another_setting_must_beat_the_best_level() -> None:
    better = other(0.2, 0.2, 0.2)
    assert tried(hill(1.0, 0.02), (better,)).chosen([0, 1, 2]) is better
    assert tried(hill(1.0, 0.15), (better,)).chosen([0, 1, 2]).setting == {LEVEL: 0.73}


def test_an_image_is_measured_with_what_the_others_speak_for() -> None:
    one = other(-0.4, 0.4, 0.4)  # which the first image would not have spoken for
    found = tried(worse, (one,))
    assert found.left_out() == (one.found[0], PLAIN[1], PLAIN[2])
    assert found.best() is one


def test_one_image_speaks_for_nothing() -> None:
    found = Trials(Trial({}, {0: 0.5}), 0.5, (), (other(0.4, 0, 0),))
    assert found.chosen([0]) is found.plain
    assert found.left_out() == (0.5,)
