"""What every suite is told: where its inputs are and how much to measure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ffseg.plugins import SEGMENTERS


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of a bench run that its suites share.

    Attributes
    ----------
    work : Path
        A temporary folder.
    images : Path, optional
        Folder of images for ``scenes``; without it the samples and drawn scenes are taken.
    quick : bool
        Tiny inputs, to see that everything runs; its figures mean nothing.
    methods : sequence of str
        Of the suite ``method``.
    """

    work: Path
    images: Path | None = None
    quick: bool = False
    methods: Sequence[str] = tuple(SEGMENTERS)
