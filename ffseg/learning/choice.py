"""Choice of a setting by its results on a few masks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import mean, stdev

import numpy as np

from ffseg.evidence.maps import log_odds
from ffseg.learning.space import LEVEL, Setting

MIN_GAIN = 0.01
"""A mean IoU that is higher by less is not worth other parameters; nor is one that is higher by less for each unit of log
odds by which the level of probabilities is moved."""

MIN_SPREAD = 0.1
"""Gains on images of one kind lie no nearer together, whatever a few images say."""

MIN_STANDARD_ERRORS = 2.0
"""Standard errors by which the best of the other settings must be better. With 1.5, three masks of floors chose settings that
on the rest came out worse by .03 in the mean; with 2.5, three masks of roads gave up a third of what there is to gain."""

NEIGHBOURS = 40
"""The spread of the gains is that of so many of the best settings: the one that is best on few images has a small one by
chance."""

LOWER_LEVEL_MARGIN = 0.1
"""Mean IoU by which lower levels must be better than the one at hand: they leak, on some images all at once."""

TEMPERATURE = 0.02
"""Mean IoU that a level may be worth less than the best and still have a third of its say."""


@dataclass(slots=True)
class Trial:
    """A setting and its IoU on the images it was tried on, by their number."""

    setting: Setting
    found: dict[int, float] = field(default_factory=dict)

    @property
    def mean(self) -> float:
        """Mean IoU on the images so far."""
        return mean(self.found.values())

    def on(self, images: Sequence[int]) -> list[float]:
        """IoU on some of the images."""
        return [self.found[number] for number in images]


@dataclass(frozen=True, slots=True)
class Trials:
    """All settings tried on all images: the current parameters, levels of probability, and other settings.

    Attributes
    ----------
    level : float
        ``region.probability`` as it is.
    """

    plain: Trial
    level: float
    levels: Sequence[Trial]
    others: Sequence[Trial]

    @property
    def images(self) -> list[int]:
        """Numbers of the images."""
        return list(self.plain.found)

    def best(self) -> Trial:
        """The setting with the highest mean, whether by much or little."""
        return max([self.plain, *self.levels, *self.others], key=lambda one: one.mean)

    def chosen(self, images: Sequence[int]) -> Trial:
        """The setting supported by the masks of some images; the current parameters if none is significantly better.

        Notes
        -----
        Another setting takes the place of the best level only where its mean is higher by ``MIN_STANDARD_ERRORS`` standard
        errors, and by ``MIN_GAIN`` at least. Nothing is chosen from one image, which cannot tell chance from kind.
        """
        if len(images) < 2:
            return self.plain
        level = self.best_level(images)
        if not self.others:
            return level
        gains = np.array([one.on(images) for one in self.others]) - level.on(images)
        first = np.argsort(-gains.mean(axis=1), kind="stable")[:NEIGHBOURS]
        spread = max(MIN_SPREAD, float(np.sqrt(gains[first].var(axis=1, ddof=1).mean())))
        least = max(MIN_GAIN, MIN_STANDARD_ERRORS * spread / len(images) ** 0.5)
        return self.others[first[0]] if gains[first[0]].mean() > least else level

    def best_level(self, images: Sequence[int]) -> Trial:
        """The level supported by two images or more, or the current parameters.

        Notes
        -----
        A level is worth its mean gain less one standard error. IoU over log odds is a flat hill, and a few images show poorly
        where its top is: it is the mean of the levels, each counted by its worth.
        """
        tried = [self.plain, *self.levels]
        moved = np.array(
            [0.0, *(log_odds(float(str(one.setting[LEVEL]))) - log_odds(self.level) for one in self.levels)]
        )
        worth = np.array([self._worth(one, images, far) for one, far in zip(tried, moved.tolist(), strict=True)])
        if worth.argmax() == 0:
            return self.plain
        say = np.exp((worth - worth.max()) / TEMPERATURE)
        return tried[int(np.abs(moved - say @ moved / say.sum()).argmin())]

    def _worth(self, one: Trial, images: Sequence[int], moved: float) -> float:
        gains = [after - before for after, before in zip(one.on(images), self.plain.on(images), strict=True)]
        handicap = LOWER_LEVEL_MARGIN if moved < 0 else 0.0
        return float(mean(gains) - stdev(gains) / len(gains) ** 0.5 - MIN_GAIN * abs(moved) - handicap)

    def left_out(self) -> tuple[float, ...]:
        """IoU of each image with the setting chosen on the others."""
        images = self.images
        return tuple(self.chosen([one for one in images if one != number]).found[number] for number in images)
