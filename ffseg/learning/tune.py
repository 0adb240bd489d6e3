"""Settings from masks: many are tried on few images, the better half on more, and judged on images left out."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from statistics import mean

import numpy as np

from ffseg.arrays import Mask
from ffseg.contour import bounded
from ffseg.errors import SegmentationError
from ffseg.image.edges import EdgeMap
from ffseg.learning.choice import Trial, Trials
from ffseg.learning.gather import LabelledImage, known_share
from ffseg.learning.space import MAX_SETTINGS, SHARED, Setting, levels, settings, with_setting
from ffseg.metrics import iou
from ffseg.parameters import Parameters
from ffseg.pipeline import segment, with_domain, with_evidence, with_method, with_starts
from ffseg.scene import NO_EDGES, Scene

BRACKET = 24
"""Settings that set out together; half of them go on to the next images."""

FIRST_IMAGES = 2
"""Images that every setting is tried on."""

LEVELS_FRACTION = 0.5
"""Part of the budget after which no other level of probability is tried."""

MAX_CACHED = 256 << 20
"""Bytes of edge maps that are kept to be shared."""

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class TuningResult:
    """Result of tuning.

    Attributes
    ----------
    setting : dict
        Overrides by key; empty where the parameters are kept.
    best : dict
        The setting with the highest mean, whether it is taken or not.
    before, after : tuple of float
        IoU of each image with the parameters as they are, and with `best`.
    left_out : tuple of float
        IoU of each image with what is best on the others.
    sensitivity : tuple of (str, float)
        For each key, how far the mean IoU of its best and worst value lie apart.
    tried : int
        Settings that were tried.
    known : float
        Part of the pixels of which the masks know something.
    left : int
        Settings for which there was no time.
    """

    setting: Setting
    best: Setting
    before: tuple[float, ...]
    after: tuple[float, ...]
    left_out: tuple[float, ...]
    sensitivity: tuple[tuple[str, float], ...]
    tried: int
    seconds: float
    known: float = 1.0
    left: int = 0


class Bench:
    """Images for trying settings; settings with the same edge parameters share edge maps."""

    def __init__(self, labelled: Sequence[LabelledImage]) -> None:
        self._labelled = labelled
        self._maps: dict[tuple[object, ...], EdgeMap] = {}
        self._bytes = 0

    def tried(self, setting: Setting) -> Trial:
        """A setting tried on all images."""
        return Trial(setting, {number: self.overlap(number, setting) for number in range(len(self._labelled))})

    def overlap(self, number: int, setting: Setting) -> float:
        """IoU on one image; 0 if it cannot be segmented."""
        mask = self.mask(number, setting)
        return 0.0 if mask is None else iou(mask, self._labelled[number].truth)

    def mask(self, number: int, setting: Setting) -> Mask | None:
        """Mask of one image; None if it cannot be segmented."""
        one = self._labelled[number]
        params = with_setting(one.params, {key: value for key, value in setting.items() if key not in one.fixed})
        try:
            shared = params.edges.source == SHARED and params.edges.model is None
            edges = self._edges(number, params) if shared else None
            scene = Scene(one.image, params, edges=edges or NO_EDGES, edges_given=shared, **one.masks.bounds)
            return segment(scene).mask
        except SegmentationError:
            return None

    def _edges(self, number: int, params: Parameters) -> EdgeMap:
        key = (number, params.edges)
        if key not in self._maps:
            one = self._labelled[number]
            scene = with_starts(with_method(Scene(one.image, params, **one.masks.bounds)))
            made = bounded(with_evidence(with_domain(scene))).edges
            self._bytes += made.gradient.nbytes + made.edges.nbytes
            while self._bytes > MAX_CACHED and self._maps:
                old = self._maps.pop(next(iter(self._maps)))
                self._bytes -= old.gradient.nbytes + old.edges.nbytes
            self._maps[key] = made
        return self._maps[key]


def tune(labelled: Sequence[LabelledImage], budget: float, tell: Tell) -> TuningResult:
    """Try settings for about `budget` seconds; `Trials` tells which to use."""
    begin = time.monotonic()
    bench, count = Bench(labelled), len(labelled)
    plain, trials = bench.tried({}), list[Trial]()
    # of a model the level alone can be moved: it does not ask for thresholds
    params = next((one for one in labelled if not one.fixed), labelled[0]).params
    modelled = params.edges.model is not None
    source = iter(()) if modelled else settings()
    end = begin + (1 if modelled else LEVELS_FRACTION) * budget
    probabilities = levels(params)
    moved = [bench.tried(setting) for setting in probabilities if time.monotonic() < end]
    while time.monotonic() - begin < budget:
        bracket = [Trial(setting) for setting in islice(source, BRACKET)]
        if not bracket:
            break
        _halve(bracket, bench, count, begin + budget)
        trials += [trial for trial in bracket if trial.found]
        tell(f"{len(moved) + len(trials)} settings tried, best {_best([plain, *moved, *trials], count).mean:.3f}")
    if modelled:
        tell(f"{len(moved)} levels tried, best {_best([plain, *moved], count).mean:.3f}")
    tried = Trials(plain, params.region.probability, moved, [it for it in trials if len(it.found) == count])
    taken = tried.chosen(tried.images)
    best = tried.best() if taken is plain else taken
    found = TuningResult(
        setting=taken.setting,
        best=best.setting,
        before=tuple(plain.found.values()),
        after=tuple(best.found[number] for number in range(count)),
        left_out=tried.left_out(),
        sensitivity=_sensitivity([*moved, *trials]),
        tried=len(moved) + len(trials),
        seconds=0.0,
        known=known_share(labelled),
        left=len(probabilities) + (0 if modelled else MAX_SETTINGS) - len(moved) - len(trials),
    )
    return replace(found, seconds=time.monotonic() - begin)


def before_and_after(labelled: Sequence[LabelledImage], tuned: TuningResult) -> list[tuple[Mask, Mask]]:
    """Regions of each image with the old and with the best setting; empty masks where there is none."""
    bench = Bench(labelled)
    pairs = []
    for number, one in enumerate(labelled):
        found = [bench.mask(number, setting) for setting in ({}, tuned.best)]
        before, after = (np.zeros(one.truth.shape, np.bool_) if mask is None else mask for mask in found)
        pairs.append((before, after))
    return pairs


def _halve(bracket: list[Trial], bench: Bench, count: int, end: float) -> None:
    """Successive halving: all on the first images, the better half on twice as many, and so on.

    After `end` no other begins a round, so that the best is still seen by all.
    """
    left, seen = bracket, 0
    while left and seen < count:
        upto = min(count, max(FIRST_IMAGES, 2 * seen))
        for trial in left:
            for number in range(seen, upto):
                trial.found[number] = bench.overlap(number, trial.setting)
            if time.monotonic() > end:  # of those that went on, the best has come first
                break
        seen = upto
        left = sorted((trial for trial in left if len(trial.found) == seen), key=lambda trial: trial.mean, reverse=True)
        left = left[: max(1, len(left) // 2)]


def _best(trials: Sequence[Trial], count: int) -> Trial:
    """The best of the settings tried on all images."""
    return max((trial for trial in trials if len(trial.found) == count), key=lambda trial: trial.mean)


def _sensitivity(trials: Sequence[Trial]) -> tuple[tuple[str, float], ...]:
    """Range of the mean IoU over the values of each key, for settings tried on all images."""
    figures = []
    keys = dict.fromkeys(key for trial in trials for key in trial.setting)
    for key in keys:
        groups: dict[str, list[float]] = {}
        for trial in trials:
            if key in trial.setting and len(trial.found) >= FIRST_IMAGES:
                first = [trial.found[number] for number in range(FIRST_IMAGES)]
                groups.setdefault(str(trial.setting[key]), []).append(mean(first))
        means = [mean(group) for group in groups.values()]
        if len(means) > 1:
            figures.append((key, max(means) - min(means)))
    return tuple(sorted(figures, key=lambda one: -one[1]))
