"""``ffseg learn``: a model of what is inside, from a few masks."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ffseg.cli import console, options
from ffseg.cli.checks import output_file, ready_params
from ffseg.cli.commands.telling import progress, warn_of_passed_over, warn_of_starts
from ffseg.errors import UsageError
from ffseg.io.files import printable
from ffseg.io.tables import counted, without_nan

if TYPE_CHECKING:
    from ffseg.learning.learn import CrossValidation
    from ffseg.learning.training import BaseChoice, PriorChoice

SUFFIX = ".ffmodel"


def learn(  # noqa: PLR0913 - the options of the command
    inputs: options.Inputs,
    truth: options.Masks,
    out: Annotated[Path, typer.Option(metavar="FILE", help="Model to write, a .ffmodel file.")],
    truth_label: options.TruthLabel = None,
    starts: options.Starts = None,
    config: options.Config = None,
    settings: options.Settings = None,
    as_json: options.AsJsonOrSentences = False,
    quick: Annotated[
        bool,
        typer.Option(
            "--quick", help="The model, and which of 20 images to draw next, and no figures: in a quarter of the time."
        ),
    ] = False,
    quiet: options.FiguresOnly = False,
) -> None:
    """Learn from a few masks what is inside, for --set edges.model=FILE of the other commands.

    Each image that has a mask is learned from; masks may be scribbles on 128. Measures the model on images left out,
    says what more masks would bring, and names the image to draw a mask of next, of the first 200 without one. Needs
    ffseg[learn]. Exit code: 0 done; 2 nothing was written.
    """
    if out.suffix != SUFFIX:
        raise UsageError(f"--out {out}: a model is a {SUFFIX} file; name it so")
    output_file("--out", out, "model")
    params = ready_params(config, settings)
    from ffseg.evidence.forest import to_bytes
    from ffseg.io.files import write_bytes_atomic
    from ffseg.learning.gather import MAX_SIDE, gather
    from ffseg.learning.learn import learn_and_measure
    from ffseg.plugins import require_lightgbm

    require_lightgbm()
    file = options.starts_file(starts, params)
    found = gather(inputs, os.fspath(truth), params, file, truth_label, longest=MAX_SIDE)
    warn_of_passed_over(found.passed_over)
    warn_of_starts([one for one in found.labelled if one.start is not None])
    model, figures = learn_and_measure(found, params, progress(quiet=quiet), measured=not quick)
    warn_of_passed_over(figures.passed_over[len(found.passed_over) :])  # what is too thin is seen then
    write_bytes_atomic(os.fspath(out), to_bytes(model))
    if as_json:
        console.data(json.dumps({"out": os.fspath(out), **without_nan(asdict(figures))}, indent=2))
    else:
        console.data("\n".join(sentences(figures, os.fspath(out))))


def sentences(figures: CrossValidation, out: str) -> list[str]:
    """What there is to say of a model."""
    from ffseg.learning.gather import MAX_SIDE, few_known

    lines = [verdict(figures, out), *few_known(figures.known)]
    if figures.copies:
        larger = counted(figures.copies, "image")
        lines.append(f"{larger} of more than {MAX_SIDE} pixels a side learned from, and measured on, as a copy")
    if figures.searched and figures.masks > 1:
        lines.append(
            "where no start is named the model finds its own; without it the contour grows from the middle of the image"
        )
    elif figures.met is not None:
        lines.append(
            f"of the starts that it finds {figures.met:.0%} lie in the masks of images left out: it is kept without, and "
            "measured from starts inside; name them with --starts FILE"
        )
    if figures.parts:
        lines.append(
            "the masks show many things apart: all that the model tells are taken, with region.islands=false one"
        )
    if figures.base is not None:
        lines.append(base_sentence(figures.base))
    if figures.prior is not None:
        lines.append(prior_sentence(figures.prior))
    if len(figures.curve) > 1:
        pairs = pairwise(figures.curve)
        steps = ", ".join(f"{high - low:+.3f} from {few} to {many}" for (few, low), (many, high) in pairs)
        lines.append(f"what more masks gave small trial models: {steps}")
    return [*lines, *advice(figures), f"use it with --set edges.model={out}"]


def verdict(figures: CrossValidation, out: str) -> str:
    """Whether the model is worth using, and by which figures."""
    learned = f"{out}, learned from {counted(figures.masks, 'mask')},"
    if figures.masks < 2:
        return f"{learned} was not measured: that takes a second mask"
    if figures.iou != figures.iou:
        return f"{learned} was not measured: that takes longer, and no --quick"
    own, without = (
        f"{value:.3f} (spread {spread:.3f})"
        for value, spread in ((figures.iou, figures.spread), (figures.without, figures.without_spread))
    )
    what = f"IoU on images left out {own}, without it {without}"
    if figures.helps:
        return f"{learned} helps: {what}"
    how = "is worse than no model" if figures.iou < figures.without else "is no better than no model beyond the noise"
    return f"{learned} {how}: {what}"


def advice(figures: CrossValidation) -> list[str]:
    """What to do next: draw more masks, leave it at these, or do without the model."""
    more = "1 more mask may" if figures.more == 1 else f"{figures.more} more masks may each"
    rises = (
        f"about {more} still raise it by .005 or more"
        if figures.more
        else "more masks of this kind will hardly raise it"
    )
    lines = []
    if figures.helps is False:
        lines = [f"do without it{'' if figures.curve and not figures.more else ', or draw more masks'}"]
    if figures.curve:
        lines.append(rises)
    if figures.following:
        sought = figures.more or figures.masks < 2 or not figures.curve
        lines.append(f"{'most useful to draw next' if sought else 'least sure of'}: {printable(figures.following)}")
    return lines


def base_sentence(base: BaseChoice) -> str:
    """Whether the forest that comes with ffseg was corrected, and why."""
    shipped = "the forest that comes with ffseg"
    how = f"corrects {shipped}" if base.corrected else f"grown from the masks alone, without {shipped}"
    few = "one mask is too little to begin with" if base.corrected else "it tells one thing from its surroundings"
    why = f"{base.enough:.2f} is enough" if base.corrected and base.base >= base.enough else few
    because = why if base.taught is None else f"they teach each other {base.taught:.2f}"
    return f"{how}, which shares {base.base:.2f} of the masks' pixels by itself ({because})"


def prior_sentence(prior: PriorChoice) -> str:
    """Whether the model asks the prior too, and why."""
    how = "asks the prior that comes with ffseg too" if prior.asked else "does not ask the prior that comes with ffseg"
    if prior.taught is None:
        return f"{how}: {'one mask is too little without it' if prior.asked else 'that tells one thing from its surroundings'}"
    return f"{how}: the masks teach each other {prior.taught:.2f}, {prior.both:.2f} with it"
