"""What scripts may rely on, read out of the code and off its commands: the end of ``docs/formats.md``."""

import json
import re
import subprocess
import sys
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import get_args

from ffseg.batch.cameras import OwnImage
from ffseg.batch.outputs.table import MAP_FILES, OBSTACLES, OUTPUTS, PARQUET, RUN, TIMINGS
from ffseg.batch.record import tables
from ffseg.bench import report
from ffseg.bench.session import Measurements
from ffseg.camera.calibration import CameraFile
from ffseg.cli.reporting import DOUBTS
from ffseg.compare import values
from ffseg.freespace.structural import Verdict
from ffseg.io.images import REASONS
from ffseg.learning.learn import CrossValidation
from ffseg.learning.tune import TuningResult
from ffseg.plugins import EDGE_SOURCES
from ffseg.schema.sections import leaves

ROOT = Path(__file__).resolve().parents[1]
MADE_BELOW = "<!-- the lists below are made from the code by pytest --update-golden -->"


@dataclass
class Everything:
    """Records with each column that a run may have."""

    columns: frozenset[str] = frozenset({"iou", "start_x", tables.TIME_COLUMN, *tables.PAST_COLUMNS})


def timings() -> tuple[str, ...]:
    return tables.Tables("", "", Everything(), camera=True).columns()  # type: ignore[arg-type]


def together() -> list[str]:
    """Files that a run writes once."""
    merged = [one.merged for one in OUTPUTS if one.merged]
    return [TIMINGS, PARQUET, OBSTACLES, RUN, *merged]


def stops() -> list[str]:
    """Names of the reasons to stop in the core, but for that of what goes on."""
    text = (ROOT / "ffseg" / "native" / "common" / "stop.hpp").read_text("utf-8")
    return [name for name in re.findall(r'"(\w+)"', text) if name != "running"]


JOB_REASONS = [
    "segmentation", "parameters", "calibration", "truth", "evidence", "output", "crash", "timeout", "out-of-memory", "internal",
]  # fmt: skip
"""Of failed rows, beside those of a file that cannot be read."""


def keys(folder: Path, *command: str) -> list[str]:
    """Keys of what a command prints with ``--json``; those of a mapping or of the rows of a list behind a point."""
    call = [sys.executable, "-m", "ffseg", *command, "--json"]
    done = subprocess.run(call, cwd=folder, check=True, stdout=subprocess.PIPE, text=True, encoding="utf-8")
    return list(keys_of(json.loads(done.stdout)))


def keys_of(document: dict[str, object]) -> Iterable[str]:
    for key, value in document.items():
        if isinstance(value, dict) and value:
            yield from (f"{key}.{inner}" for inner in value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            yield from (f"{key}[].{inner}" for inner in value[0])
        else:
            yield key


def lists(folder: Path) -> list[tuple[str, Sequence[str]]]:
    """Every list of names with its title; `folder` is one to work in."""
    toy = str(ROOT / "samples" / "toy.png")
    planned = keys(folder, "run", toy, "--out", "out", "--dry-run")
    done = keys(folder, "run", toy, "--out", "out")
    keys(folder, "run", toy, "--out", "part", "--shard", "1/1")
    merged = keys(folder, "merge", "part")
    written = json.loads((folder / "out" / "run.json").read_text("utf-8"))
    compared = keys(folder, "compare", toy, "--out", "table", "--methods", "freeform")
    columns = timings()
    return [
        ("files of `run`, for each image", [f"{one.folder}/NAME{one.suffix}" for one in OUTPUTS]),
        ("files of `run`, for all together", [*together(), *MAP_FILES]),
        ("`timings.csv`", columns),
        ("`obstacles.csv`", tables.OBSTACLE_COLUMNS),
        ("`compare.csv`", values.COLUMNS),
        ("`bench.csv`", report.COLUMNS),
        ("`run.json`", [*written, "map"]),  # of a drive, with --map
        ("`run --json`", [*(key for key in done if "[]" not in key), "images[].COLUMN"]),
        ("`run --dry-run --json`", planned),
        ("`merge --json`", merged),
        ("`compare --json`", [*(key for key in compared if "[]" not in key), "rows[].COLUMN"]),
        ("`domain --json`", ["out", *(f"masks[].{one.name}" for one in fields(OwnImage))]),
        ("`learn --json`", ["out", *(one.name for one in fields(CrossValidation))]),
        ("`tune --json`", ["out", *(one.name for one in fields(TuningResult))]),
        ("`bench --json`, `bench.json`", list(json.loads(report.to_json(Measurements(True, "", {}, {}))))),
        ("camera file", list(leaves(CameraFile))),
        ("cell `source`", list(EDGE_SOURCES)),
        ("cell `stop_reason`", stops()),
        ("cell `doubts`, several apart by blanks", list(DOUBTS)),
        ("cell `verdict`", get_args(Verdict)),
        ("cell `error`, before the colon", [*REASONS, *JOB_REASONS]),
    ]


def page(folder: Path) -> str:
    """The lists as Markdown."""
    return "\n".join(bullet(title, names) for title, names in lists(folder)) + "\n"


def bullet(title: str, names: Sequence[str]) -> str:
    text = f"- {title}: {', '.join(f'`{name}`' for name in names)}"
    return textwrap.fill(text, 120, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
