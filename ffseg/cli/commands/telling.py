"""Messages shared by `ffseg learn` and `ffseg tune`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from ffseg.cli import console

if TYPE_CHECKING:
    from ffseg.learning.gather import LabelledImage


def progress(*, quiet: bool) -> Callable[[str], None]:
    """What takes lines on the progress: stderr, or nothing."""
    return (lambda _: None) if quiet else (lambda text: console.message(f"ffseg: {text}"))


def warn_of_starts(labelled: Sequence[LabelledImage]) -> None:
    """Say which images have a start outside their mask.

    Raises
    ------
    UsageError
        If all have.
    """
    from ffseg.learning.gather import some_names, starts_off

    names = starts_off(labelled)
    if names:
        console.message(
            f"ffseg: warning: the start lies outside the mask of {some_names(names)}; correct one of the two"
        )


def warn_of_passed_over(images: Sequence[str]) -> None:
    """Say which images are not learned from, and why."""
    from ffseg.learning.gather import MAX_NAMED

    for image in images[:MAX_NAMED]:
        console.message(f"ffseg: warning: passed over {image}")
    if len(images) > MAX_NAMED:
        console.message(f"ffseg: warning: passed over {len(images) - MAX_NAMED} more images")


def warn_of_seen(labelled: Sequence[LabelledImage]) -> None:
    """Say which images the model of the parameters has learned from, by their names."""
    from ffseg.evidence.source import learned_from
    from ffseg.io.files import printable
    from ffseg.learning.gather import some_names

    seen = learned_from(labelled[0].params)
    names = [printable(one.name) for one in labelled if one.name in seen]
    if names:
        console.message(
            f"ffseg: warning: edges.model has learned from images called {some_names(names)}; "
            "on those it does too well to be tuned"
        )
