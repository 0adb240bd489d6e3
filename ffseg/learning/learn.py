"""A model from masks: grown, cross-validated, with the benefit of more masks and the next ones to draw."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from math import exp
from statistics import mean, pstdev, stdev

import numpy as np

from ffseg import __version__
from ffseg.arrays import Image, Mask, Plane
from ffseg.batch.plan.sources import InputImage
from ffseg.batch.workers.pictures import read_source
from ffseg.enlargement import smaller, smaller_masks
from ffseg.errors import ImageReadError, SegmentationError, UsageError
from ffseg.evidence.features import features
from ffseg.evidence.forest import MODEL_ODDS_RATIO, UNMEASURED, Model
from ffseg.evidence.prior import prior
from ffseg.evidence.source import model_odds, model_start
from ffseg.image.appearance import Appearance
from ffseg.image.edges import PRIOR_CALIBRATION, ScoreCalibration
from ffseg.image.resized import copy_of
from ffseg.io.files import printable
from ffseg.io.tables import counted, without_nan
from ffseg.learning.examples import Example, samples, size_of_things, starts_in
from ffseg.learning.gather import MAX_SIDE, LabelledImage, TrainingSet, known_share, start_region
from ffseg.learning.training import FOLDS, BaseChoice, PriorChoice, SampleSet, at_once, grown, learn
from ffseg.metrics import IGNORED, INSIDE, iou
from ffseg.parameters import Parameters
from ffseg.pipeline import segment
from ffseg.scene import Scene

CURVE_TREES = 40
"""Trees of the forests that only show how figures rise with the number of masks."""

DRAWS, MAX_TESTED = 3, 10
"""Random choices of masks at each number, and images that each is tested on."""

MIN_WORTH = 0.005
"""A mask that raises the mean IoU by less is not worth drawing."""

MIN_STANDARD_ERRORS = 2.0
"""Standard errors that a model's figure must be above the figure without it to be called better."""

BESIDE = 0.9
"""Promised overlap of the image that is counted beside those left out: of a few, luck alone tells little."""

MAX_LOG_RATIO = 10.0
"""Largest logarithm of a ratio that is fitted, either way."""

MIN_MET = 0.5
"""Part of the starts that a model finds which have to lie in the masks, as in kinds with many things alike they do not: each
that lies elsewhere costs a click more than none does."""

MAX_UNMARKED, FEW_UNMARKED = 200, 20
"""Images without a mask that are looked at to name the next, and those of them that a model which is not measured waits for."""

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class CrossValidation:
    """Figures of a model on images that it was not learned from.

    Attributes
    ----------
    iou, spread : float
        Mean and standard deviation of the IoU over the images left out; NaN where that was not measured, as from one mask.
    without, without_spread : float
        The same without the model, on the same images.
    helps : bool or None
        Whether the mean of the differences is above zero by more than its noise; None where that was not measured.
    curve : tuple of (int, float)
        Number of masks and mean IoU of the contours on others, of small forests used as models are.
    more : int
        How many more masks may each still raise the mean by ``MIN_WORTH``.
    following : str
        The image to draw a mask of next; empty where all have one, or nothing tells where to start.
    base : BaseChoice or None
        Whether the forest that comes with ffseg was corrected, and why.
    prior : PriorChoice or None
        Whether the prior that comes with ffseg is asked too, and why.
    known : float
        Part of the pixels of which the masks know something.
    searched : bool
        Whether the model looks for starts where none is named; without a model they are grown from the middle then.
    order : tuple of str
        Images without a mask, those the model is least sure of first; `following` is the first.
    odds_ratio : float
        Odds of the overlap that the model promises over the odds of the IoU on images left out: what its scores are made with.
    met : float or None
        Share of the images left out in which the start that the model finds lies in the mask; None where that was not measured.
        Below `MIN_MET` the model is kept without, and all figures are of starts in the masks.
    passed_over : tuple of str
        Images with a mask that was not learned from, each with what is wrong.
    copies : int
        Images that were learned from, and measured on, as copies of at most `MAX_SIDE` pixels a side.
    parts : bool
        Whether the masks mean all things of a kind, so that all parts are taken that the model tells.
    """

    masks: int
    iou: float
    spread: float
    without: float
    without_spread: float
    helps: bool | None
    curve: tuple[tuple[int, float], ...] = ()
    more: int = 0
    following: str = ""
    base: BaseChoice | None = None
    prior: PriorChoice | None = None
    known: float = 1.0
    searched: bool = False
    order: tuple[str, ...] = ()
    odds_ratio: float = MODEL_ODDS_RATIO
    met: float | None = None
    passed_over: tuple[str, ...] = ()
    copies: int = 0
    parts: bool = False


@dataclass(frozen=True, slots=True)
class LeftOut:
    """What is found in an image that was left out.

    Attributes
    ----------
    promised : float or None
        Overlap that the model promises of it, if it has decided and nothing else is doubted.
    met : bool or None
        Whether the start that the model finds lies in the mask; None where it was not asked for one, or the mask does not tell.
    """

    iou: float
    promised: float | None = None
    met: bool | None = None


def learn_and_measure(
    gathered: TrainingSet, params: Parameters, tell: Tell, *, measured: bool = True
) -> tuple[Model, CrossValidation]:
    """Learn a model and, if `measured`, cross-validate it.

    Raises
    ------
    UsageError
        If each mask shows too little of a side at the size that is looked at, or LightGBM is not installed.
    """
    gathered, chosen = _sampled(gathered, params, tell)
    model = learn(chosen)
    tell(f"grown from {counted(len(chosen), 'mask')}")
    figures = _figures(gathered.labelled, chosen, tell) if measured else _unmeasured(len(chosen))
    met = figures.met is None or figures.met >= MIN_MET
    model = model if met else replace(model, start=None)
    order = _order(gathered, model, params, tell, MAX_UNMARKED if measured else FEW_UNMARKED)
    figures = replace(
        figures,
        following=order[0] if order else "",
        base=BaseChoice(**model.about["base"]),
        prior=None if model.about["prior"] is None else PriorChoice(**model.about["prior"]),
        known=known_share(gathered.labelled),
        copies=sum(one.factor > 1 for one in gathered.labelled),
        parts=model.parts,
        searched=met and any(one.start is None for one in gathered.labelled),
    )
    names = [one.name for one in gathered.labelled][:100]
    about = {"ffseg": __version__, "images": names, **without_nan(asdict(figures))}
    return replace(model, about=about), replace(figures, order=order, passed_over=gathered.passed_over)


def _sampled(gathered: TrainingSet, params: Parameters, tell: Tell) -> tuple[TrainingSet, SampleSet]:
    """Samples of the images whose masks show enough of both sides, and the set without the others."""
    labelled, chosen, refused = list[LabelledImage](), [], list[UsageError]()
    size = size_of_things([one.truth for one in gathered.labelled])
    for one in gathered.labelled:
        tell(f"looking at {printable(one.name)}")
        try:
            radius = smaller(params, one.factor).init.radius_in(one.image.shape)
            seen = samples(Example(one.image, one.truth, one.start, radius), size)
            chosen.append(replace(seen, apart=1.0) if params.region.islands == "all" else seen)
            labelled.append(one)
        except UsageError as error:
            refused.append(UsageError(f"{printable(one.name)}: {error}"))
    if not chosen:
        raise refused[0]
    passed_over = (*gathered.passed_over, *map(str, refused))
    return replace(gathered, labelled=labelled, passed_over=passed_over), SampleSet(chosen)


def _unmeasured(count: int) -> CrossValidation:
    none = float("nan")
    return CrossValidation(count, none, none, none, none, helps=None)


def _figures(labelled: Sequence[LabelledImage], chosen: SampleSet, tell: Tell) -> CrossValidation:
    count = len(labelled)
    if count < 2:
        return _unmeasured(count)
    found, models, parts = dict[int, LeftOut](), dict[int, Model](), chosen.left_out()

    def learned(parted: tuple[SampleSet, SampleSet]) -> Model:
        others, part = parted
        return learn(others, searched=any(labelled[i].start is None for i in part.numbers))

    for number, ((_, part), model) in enumerate(zip(parts, at_once(learned, parts), strict=True)):
        models |= dict.fromkeys(part.numbers, model)
        found |= {i: _left_out(labelled[i], model) for i in part.numbers}
        tell(f"left out part {number + 1} of {len(parts)}: IoU {mean(found[i].iou for i in part.numbers):.3f}")
    met = [one.met for one in found.values() if one.met is not None]
    if met and mean(met) < MIN_MET:
        tell("most starts that the model finds lie outside the masks: measured from starts inside")
        rng = np.random.default_rng(0)
        labelled = [_started(one, rng) for one in labelled]
        found = {i: _left_out(one, models[i]) for i, one in enumerate(labelled)}
    own = [found[i].iou for i in range(count)]
    other = [_contoured(one, _without_model(one.params), None).iou for one in labelled]
    gains = [a - b for a, b in zip(own, other, strict=True)]
    helps = mean(gains) > MIN_STANDARD_ERRORS * stdev(gains) / len(gains) ** 0.5
    curve = _curve(labelled, chosen)
    more = _worth_drawing(curve, count)
    figures = CrossValidation(count, mean(own), pstdev(own), mean(other), pstdev(other), helps, curve, more)
    ratio = fitted_ratio([(one.promised, one.iou) for one in found.values() if one.promised is not None])
    return replace(figures, odds_ratio=ratio, met=mean(met) if met else None)


def fitted_ratio(found: Sequence[tuple[float, float]]) -> float:
    """The ratio by which overlaps promised become, in the mean, the IoU beside each: logistic regression with a slope of one.

    One image is counted beside these, of which as much was found as is where a model that was not measured promises `BESIDE`.
    """
    pairs = [*found, (BESIDE, UNMEASURED.iou(BESIDE))]
    low, high = -MAX_LOG_RATIO, MAX_LOG_RATIO
    for _ in range(40):
        middle = (low + high) / 2
        calibration = ScoreCalibration(1.0, exp(middle))
        if sum(calibration.iou(overlap) - iou for overlap, iou in pairs) > 0:
            low = middle
        else:
            high = middle
    return exp((low + high) / 2)


def _without_model(params: Parameters) -> Parameters:
    return replace(params, edges=replace(params.edges, model=None))


def _left_out(one: LabelledImage, model: Model) -> LeftOut:
    """What is found in an image with a model's probabilities."""
    seen = model.appearance(one.image)
    params, start = _begun(model, seen, _without_model(one.params), one.start)
    found = _contoured(one, params, None if start is None else model_odds(model, seen, start), parts=model.parts)
    return found if one.start is not None else replace(found, met=_met(start, one.truth))


def _met(start: Mask | None, truth: Image) -> bool | None:
    """Whether a start lies in a mask for the most part; None where the mask knows nothing of it."""
    if start is None:
        return False
    levels = truth[start & (truth != IGNORED)]
    return bool(np.mean(levels == INSIDE) > 0.5) if levels.size else None


def _begun(model: Model, image: Appearance, params: Parameters, start: Mask | None) -> tuple[Parameters, Mask | None]:
    """Where a contour begins with a model: in the start that is named or, without one, where the model looks for it."""
    if start is not None:
        return params, start
    circle = model_start(image, model, params.init.radius_in(image.image.shape))
    params = params if circle is None else replace(params, init=replace(params.init, circles=(circle,)))
    return params, start_region(image.image.shape[:2], params)


def _contoured(one: LabelledImage, params: Parameters, evidence: Plane | None, *, parts: bool = False) -> LeftOut:
    """What is found in an image by some evidence: in all parts that it tells, or from the start."""
    if parts and evidence is None:  # it has found none
        return LeftOut(iou(np.zeros(one.truth.shape, np.bool_), one.truth))
    if parts and params.region.islands:
        params = replace(params, region=replace(params.region, islands="all"))
    try:
        found = segment(Scene(one.image, params, evidence=evidence, **one.masks.bounds))
    except SegmentationError:
        return LeftOut(0.0)
    promise = PRIOR_CALIBRATION.overlap(found.score) if found.source == "evidence" and not found.doubts else None
    return LeftOut(iou(found.mask, one.truth), promise)


def _curve(labelled: Sequence[LabelledImage], chosen: SampleSet) -> tuple[tuple[int, float], ...]:
    """Learning curve: mean IoU on other images of small forests from 1, 2, 4, ... masks.

    Notes
    -----
    Where no start is named it is drawn inside the mask: the curve shows what masks teach, not how well starts are found.
    All models are tested on one image before the next is looked at, as features take much more room than models.
    """
    count, rng = len(chosen), np.random.default_rng(0)
    labelled = [_started(replace(one, params=_without_model(one.params)), rng) for one in labelled]
    if any(one.start is None for one in labelled):
        return ()
    tests: list[list[tuple[int, Model]]] = [[] for _ in labelled]
    most = count - -(-count // FOLDS)
    numbers = sorted({*(2**power for power in range(count.bit_length()) if 2**power < most), most})
    drawn = [(number, rng.permutation(count).tolist()) for number in numbers for _ in range(DRAWS)]
    models = at_once(lambda one: grown(chosen.some(one[1][: one[0]]), CURVE_TREES), drawn)
    for (number, order), model in zip(drawn, models, strict=True):
        for i in order[number:][:MAX_TESTED]:
            tests[i].append((number, model))
    found = list[tuple[int, int, float]]()
    for place, (one, asked) in enumerate(zip(labelled, tests, strict=True)):
        if one.start is None or not asked:
            continue
        image = Appearance(one.image, chosen.size)
        seen, odds = features(image, one.start), prior(image.usual, one.start)
        for number, model in asked:
            found.append((number, place, _contoured(one, one.params, model.map(seen, odds), parts=model.parts).iou))
    return levelled(found)


def levelled(found: Sequence[tuple[int, int, float]]) -> tuple[tuple[int, float], ...]:
    """Mean IoU at each number of masks, of triples of number, image and IoU, as if each had been tested on all images.

    By least squares it is what the number gives, and what the image does: none looks better for images that happen to be easy.
    """
    numbers, images, overlaps = zip(*found, strict=True)
    (each, at), (all_images, which) = (np.unique(values, return_inverse=True) for values in (numbers, images))
    design = np.concatenate([np.eye(len(each))[at], np.eye(len(all_images))[which]], axis=1)
    effects = np.linalg.lstsq(design, np.array(overlaps), rcond=None)[0]
    means = effects[: len(each)] + effects[len(each) :].mean()
    return tuple(zip(each.tolist(), means.round(4).tolist(), strict=True))


def _started(one: LabelledImage, rng: np.random.Generator) -> LabelledImage:
    """The image with a start inside its mask, if it has none and the mask has room for one."""
    radius = one.params.init.radius_in(one.image.shape)
    drawn = [] if one.start is not None else starts_in(Example(one.image, one.truth, None, radius), rng)
    if not drawn:
        return one
    y, x = (float(places.mean()) for places in np.nonzero(drawn[0]))
    circle = (x, y, float(np.sqrt(np.count_nonzero(drawn[0]) / np.pi)))
    return replace(one, start=drawn[0], params=replace(one.params, init=replace(one.params.init, circles=(circle,))))


def _worth_drawing(curve: Sequence[tuple[int, float]], count: int) -> int:
    """Number of further masks each of which raises the mean by ``MIN_WORTH``, by a line through IoU over 1 / masks."""
    if len(curve) < 2:
        return 0
    inverse, height = np.array([1 / number for number, _ in curve]), np.array([value for _, value in curve])
    slope = -float(np.polyfit(inverse, height, 1)[0])
    last = count
    while slope / (last * (last + 1)) >= MIN_WORTH:
        last += 1
    return last - count


def _order(gathered: TrainingSet, model: Model, params: Parameters, tell: Tell, most: int) -> tuple[str, ...]:
    """Images without a mask, at most so many, spread over the first ``MAX_UNMARKED``, in order of falling uncertainty."""
    first = gathered.others[:MAX_UNMARKED]
    doubts = {one.name: _doubt(one, gathered, model, params, tell) for one in first[:: -(-len(first) // most) or 1]}
    order = tuple(sorted((name for name, doubt in doubts.items() if doubt >= 0), key=doubts.__getitem__, reverse=True))
    if order:
        tell(f"least sure of {printable(order[0])}")
    return order


def _doubt(source: InputImage, gathered: TrainingSet, model: Model, params: Parameters, tell: Tell) -> float:
    """Uncertainty of an image; -1 if nothing tells where to start, and with a message if it cannot be read."""
    try:
        image = read_source(source, levels=params.input.range)
    except ImageReadError as error:
        tell(f"passed over: {error}")
        return -1.0
    own = gathered.starts[source.name].placed(params, image.shape) if source.name in gathered.starts else params
    image, factor = copy_of(image, MAX_SIDE)
    own, shape = smaller(own, factor), (image.shape[0], image.shape[1])
    masks = gathered.masks if factor == 1 else smaller_masks(gathered.masks, shape)
    seen = model.appearance(image)
    _, start = _begun(model, seen, own, start_region(shape, own, masks.start))
    if start is None and model.start is None:
        return -1.0
    if start is None or not start.any():
        return 1.0
    return uncertainty(model, seen, start)


def uncertainty(model: Model, image: Appearance, start: Mask) -> float:
    """Mean uncertainty of a model's probabilities, with the prior if used: 0 if all are sure, 1 if all are even."""
    return float(np.mean(1 - np.abs(2 * model_odds(model, image, start) - 1)))
