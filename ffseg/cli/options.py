"""Arguments and options that several commands share."""

from __future__ import annotations

import json
import os
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ffseg.cli import completion
from ffseg.cli.checks import folder
from ffseg.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from ffseg.parameters import Parameters

Inputs = Annotated[
    list[str], typer.Argument(metavar="INPUT...", help="Image files, folders (searched to any depth) or patterns.")
]
SomeInputs = Annotated[
    list[str] | None,
    typer.Argument(metavar="INPUT...", help="Image files, folders (any depth), patterns, .tar files or s3:// URLs."),
]
Out = Annotated[
    Path, typer.Option("--out", metavar="DIR", parser=folder, help="Folder for the outputs; made if absent.")
]
Config = Annotated[
    str | None,
    typer.Option(
        "--config", metavar="FILE|PRESET", autocompletion=completion.presets, help="Parameter file or preset."
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", autocompletion=completion.settings, help="Override a parameter; may be repeated."
    ),
]
AllowCode = Annotated[
    bool,
    typer.Option("--allow-code", help="Let the parameter file name functions (module:function): code is imported."),
]
Starts = Annotated[
    Path | None,
    typer.Option("--starts", metavar="FILE", help="CSV image,x,y[,radius], or of ffseg pick: each image's starts."),
]
Evidence = Annotated[
    Path | None,
    typer.Option("--evidence", metavar="DIR", help="Folder or .tar of maps (NAME.png, .tiff, .npy) of what is inside."),
]
Table = Annotated[
    str, typer.Option("--table", metavar="LIST", help="Tables to write: csv, or csv,parquet for timings.parquet too.")
]
Report = Annotated[bool, typer.Option("--report", help="Write report.html, a page to look at it all.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of the table.")]
AsJsonOrSentences = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of sentences.")]
Masks = Annotated[
    Path, typer.Option("--truth", metavar="DIR", help="Masks (NAME.png): 255 inside, 0 outside, 128 unknown.")
]
FiguresOnly = Annotated[bool, typer.Option("--quiet", "-q", help="No progress; the figures only.")]
TruthLabel = Annotated[
    int | None,
    typer.Option("--truth-label", metavar="K", min=0, max=65535, help="Class number that is inside in true masks."),
]
At = Annotated[
    list[str] | None,
    typer.Option("--at", metavar="X,Y[,R]", help="Where the contour starts, a point or circle; may be repeated."),
]
Outside = Annotated[
    list[str] | None,
    typer.Option("--not", metavar="X,Y[,R]", help="A point or circle outside the region; may be repeated."),
]
Boxes = Annotated[
    list[str] | None,
    typer.Option(
        "--box", metavar="X,Y,W,H", help="A box round the object: all outside is background; may be repeated."
    ),
]
Largest = Annotated[
    int | None, typer.Option("--largest", metavar="N", min=0, help="Keep the N largest regions: region.largest.")
]
MinArea = Annotated[
    int | None, typer.Option("--min-area", metavar="PX", min=0, help="Drop smaller regions: region.min_area.")
]
FillHoles = Annotated[
    int | None, typer.Option("--fill-holes", metavar="PX", min=0, help="Fill smaller holes: region.fill_holes.")
]
Label = Annotated[
    str | None, typer.Option("--label", metavar="NAME", help="Class of the regions in exports: region.label.")
]


def overrides(arguments: Mapping[str, Any]) -> list[str]:
    """What ``--set`` says, then ``--at``, ``--box``, ``--not`` and what is kept of the result and how it is called.

    Parameters
    ----------
    arguments : mapping
        Values of the options by the names that `run` and `segment` give them.
    """
    boxes, outside = arguments["boxes"], arguments["outside"]
    starts = _places("--at", arguments["at"] or ())
    if starts and arguments.get("starts"):
        raise UsageError("--at starts every image at one place, --starts each at its own; leave out one of them")
    named = _started(starts, corrects=bool(boxes))
    named += [f"init.boxes=[{', '.join(map(_corners, boxes))}]"] if boxes else []
    named += [f"init.background={_listed(_places('--not', outside))}"] if outside else []
    kept = {key: arguments[key] for key in ("largest", "min_area", "fill_holes", "label") if arguments[key] is not None}
    named += [f"region.{key}={json.dumps(value, ensure_ascii=False)}" for key, value in kept.items()]
    return [*(arguments["settings"] or ()), *named]


def _corners(box: str) -> str:
    """Corners of the columns and rows from X and Y on."""
    cells = box.split(",")
    if len(cells) != len("XYWH") or not all(map(_is_number, cells)) or min(map(float, cells[2:])) <= 0:
        raise UsageError(f"--box {box}: write X,Y,W,H in pixels, such as --box 120,80,60,40")
    x, y, width, height = map(float, cells)
    return f"[{x - 0.5!r}, {y - 0.5!r}, {x + width - 0.5!r}, {y + height - 0.5!r}]"


def _started(places: list[str], *, corrects: bool) -> list[str]:
    """Overrides for starts: one alone is as wide as `init.radius` says if it says nothing, others are clicks."""
    if len(places) != 1 or corrects:
        return [f"init.circles={_listed(places)}"] if places else []
    x, y, *radius = places[0].split(",")
    return [f"init.center=[{x}, {y}]", *(f"init.radius={one}" for one in radius)]


def _places(option: str, texts: Collection[str]) -> list[str]:
    """The texts of an option, each two or three numbers."""
    for text in texts:
        if len(text.split(",")) not in (2, 3) or not all(map(_is_number, text.split(","))):
            raise UsageError(f"{option} {text}: write X,Y or X,Y,R in pixels, such as {option} 120,80,10")
    return list(texts)


def _listed(places: Collection[str]) -> str:
    return f"[{', '.join(f'[{one}]' for one in places)}]"


def _is_number(text: str) -> bool:
    try:
        return isfinite(float(text))
    except ValueError:
        return False


def starts_file(starts: Path | None, params: Parameters) -> str:
    """Name of the starts file, or empty; refused where the parameters give starts of another kind."""
    if starts is None:
        return ""
    from ffseg.io.starts import check_starts

    check_starts(params, starts)
    return os.fspath(starts)
