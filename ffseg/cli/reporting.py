"""Messages of a run while it works and at its end."""

from __future__ import annotations

import csv
import json
import os
import re
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ffseg.batch.plan.jobs import Plan
from ffseg.batch.plan.reading import display_path
from ffseg.batch.plan.sources import Job
from ffseg.batch.record.ledger import Summary
from ffseg.batch.runner import Run
from ffseg.cli import console
from ffseg.io.files import printable
from ffseg.io.films import is_film
from ffseg.io.starts import Start
from ffseg.io.tables import counted

if TYPE_CHECKING:
    from ffseg.batch.preview import Preview  # loads OpenCV

_MAX_TOLD = 100
"""Failures, and as many notes, told on the terminal; ``timings.csv`` has them all."""

DISAGREE = (
    "every IoU is 0: the true masks hold nothing of what was found; look at --truth, at --truth-label and at the start"
)


def disagree(overlaps: Iterable[float | None]) -> bool:
    """Whether masks were compared and not one agrees anywhere, as when the class or the folder is another."""
    known = [value for value in overlaps if value is not None]
    return bool(known) and max(known) == 0


class ProgressBar:
    """Progress bar and messages on stderr; what is to be told of images stands below the bar when it has ended.

    Parameters
    ----------
    total : int
    bar : bool
        Show a bar, if stderr is a terminal.
    verbose : bool
        Say a line for each image.
    quiet : bool
        Say failures only.
    """

    def __init__(self, total: int, *, bar: bool, verbose: bool, quiet: bool = False) -> None:
        self._verbose, self._quiet = verbose, quiet
        self._told: Counter[str] = Counter()
        self._kept: list[str] = []
        self._bar: Any = None
        if bar and total > 1 and sys.stderr.isatty():
            from tqdm import tqdm

            self._bar = tqdm(total=total, unit="image", file=sys.stderr, dynamic_ncols=True)

    def finished(self, job: Job, status: str, note: str) -> None:
        """Count an image, and name it when it failed or there is something to tell."""
        if note and not (self._quiet and status != "failed"):
            self._told[status] += 1
            if self._told[status] <= _MAX_TOLD:
                self._tell(f"{printable(job.source.display_path)}: {' '.join(note.split())}")
            elif self._told[status] == _MAX_TOLD + 1:
                self._tell(f"further {'failures' if status == 'failed' else 'notes'} are in timings.csv only")
        elif self._verbose:
            self.note(f"{printable(job.source.display_path)}: {'unchanged' if status == 'unchanged' else 'done'}")
        if self._bar is not None:
            self._bar.update()

    def _tell(self, text: str) -> None:
        """Say a line, behind the bar if there is one, which counts it."""
        if self._bar is None:
            self.note(text)
            return
        self._kept.append(text)
        failed = self._told["failed"]
        counts = ((failed, "failed"), (self._told.total() - failed, "with notes"))
        self._bar.set_postfix_str(", ".join(f"{count} {what}" for count, what in counts if count), refresh=False)

    def note(self, text: str) -> None:
        """Say a line without tearing the bar."""
        if self._bar is not None:
            self._bar.clear()
        console.message(f"ffseg: {text}")
        if self._bar is not None:
            self._bar.refresh()

    def close(self) -> None:
        """Leave the terminal as it was."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None
        for text in self._kept:
            self.note(text)
        self._kept.clear()


def show_skipped(plan: Plan, *, quiet: bool) -> None:
    """Say which files of the folders are left out because they are no images."""
    count = sum(number for _, number in plan.skipped)
    if count and not quiet:
        kinds = ", ".join(f"{number} {printable(suffix) or 'without a suffix'}" for suffix, number in plan.skipped[:5])
        more = ", ..." if len(plan.skipped) > 5 else ""
        console.message(f"ffseg: left out as no images: {counted(count, 'file')} of the folders ({kinds}{more})")


def show_without_start(plan: Plan, starts: str) -> None:
    """Say how many images a starts file does not name."""
    names = [printable(job.source.display_path) for job in plan.jobs if job.start is None and not job.source.problem]
    if names:
        where = f"{counted(len(names), 'image')} of {len(plan.jobs)} without a row in {printable(starts)}"
        film = any(is_film(job.source.name) and not job.past for job in plan.jobs[1:])
        console.message(
            f"ffseg: {where} start as init or the model says: {', '.join(names[:3])}{', ...' * (len(names) > 3)}"
            + "; with --steady they follow the frame before" * film
        )


def show_plan(previews: Iterable[Preview], plan: Plan, *, as_json: bool) -> bool:
    """Print what a run would do, one line an image, or as one JSON document; False if an image is known to fail."""
    images, failed, unchanged = [], 0, 0
    for one in previews:
        failed, unchanged = failed + (one.status == "failed"), unchanged + (one.status == "unchanged")
        if as_json:
            images.append(_planned(one, plan))
        else:
            console.data(_plan_line(one))
    if as_json:
        console.data(json.dumps({"out": plan.out, "images": images}, indent=2))
    else:
        count = len(plan.jobs)
        parts = f"{count - failed - unchanged} to do, {unchanged} unchanged, {failed} failed"
        console.message(f"ffseg: {count} images into {printable(plan.out)}: {parts}; nothing was written")
    return not failed


def _planned(one: Preview, plan: Plan) -> dict[str, Any]:
    job = one.job
    return {
        "image": printable(job.source.name),
        "path": job.source.display_path,
        "status": one.status,
        "outputs": list(plan.outputs(job)),
        "truth": display_path(job.truth),
        "problem": one.error,
        "start": _start_told(job.start) if job.start else None,
    }


def _plan_line(one: Preview) -> str:
    job = one.job
    circles = job.start.circles if job.start else ()
    where = " (start at " + "; ".join(map(_circle_told, circles)) + ")" if circles else ""
    where = " (follows the frame before)" if job.start and job.start.held else where
    words = {"failed": f"failed: {one.error}", "unchanged": "unchanged"}
    what = words.get(one.status) or ", ".join(map(printable, one.missing)) or "the IoU"
    return f"{printable(job.source.display_path)}{where} -> {what}"


def _circle_told(one: Start) -> str:
    return f"{one.x:g}, {one.y:g}" + ("" if one.radius is None else f", radius {one.radius:g}")


def _start_told(start: Start) -> dict[str, Any]:
    """As JSON: the circle, and what else there is."""
    more = {key: value for key, value in asdict(start).items() if key not in ("x", "y", "radius", "others") and value}
    circle: dict[str, Any] = {"x": start.x, "y": start.y, "radius": start.radius}
    others = [_start_told(one) | {"others": []} for one in start.others]
    return circle | ({"others": others} if others else {}) | more


def show_result(run: Run, out: str, *, as_json: bool, verbose: bool = False) -> None:
    """Print how a run ended: the summary table, or one JSON document with every row.

    Pairs that could not be tested are said on stderr; with `verbose` what came of every pair.
    """
    summary, finished = run.summary, list(run.rows())
    lines = [*(motions(finished) if verbose else ()), *(nothing_tested(finished, out) or untested_pairs(finished))]
    lines += frames_left_out(summary.drive)
    lines += [DISAGREE] if disagree(row.get("iou") for row in finished) else []
    for line in lines:
        console.message(f"ffseg: {line}")
    if as_json:
        value = {
            "out": out,
            "counts": summary.counts(),
            "seconds": round(summary.seconds, 3),
            "problems": summary.problems,
            **({"map": summary.drive} if summary.drive else {}),
        }
        console.data(json.dumps({**value, **_figures(finished), "images": finished}, indent=2))
        return
    console.summary([*_lines(summary, finished), ("output", printable(out))])


def frames_left_out(drive: Mapping[str, Any]) -> list[str]:
    """Frames that are not in the map, by name."""
    lost = drive.get("lost", ())
    lines = [f"not in the map: {one['image']}: {one['reason']}" for one in lost[:_MAX_TOLD]]
    more = drive.get("frames", 0) - drive.get("fused", 0) - len(lines)
    return [*lines, f"not in the map: {more} more; map/trajectory.csv has them all"] if more else lines


DOUBTS = {
    "empty": "with an empty region",
    "filled": "fill their image",
    "border": "end at the border nearly all round",
    "early": "stopped before they had converged",
    "start": "with a start across an edge",
}
"""Words for the doubts of `ffseg.Segmentation.doubts`, to follow their number."""


def _map_told(drive: Mapping[str, Any]) -> str:
    ways = f"{drive['nodes']} nodes, {drive['edges']} ways, {drive['loops']} loops"
    drift = f"drift {drive['drift_m']:.3f} m, {drive['drift_deg']:.2f} deg" if drive["fused"] else "nothing to show"
    return f"{drive['fused']} of {drive['frames']} frames; {drift}; {ways}"


def _figures(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """What the rows say together: images that stopped before they had converged, doubts by name, and the mean IoU."""
    from statistics import fmean

    overlaps = [row["iou"] for row in rows if row.get("iou") is not None]
    stopped = sum(row.get("stop_reason") == "max_iterations" for row in rows)
    doubts = Counter(name for row in rows for name in (row.get("doubts") or "").split())
    return {"max_iterations": stopped, "doubts": dict(doubts), "mean_iou": fmean(overlaps) if overlaps else None}


def _lines(summary: Summary, rows: Sequence[Mapping[str, Any]]) -> list[tuple[str, str]]:
    from statistics import median

    rate = summary.done / max(summary.seconds, 1e-9)
    named = {"images": "total", "done": "done", "unchanged": "unchanged", "failed": "failed"}
    lines = [(label, str(getattr(summary, name))) for label, name in named.items()]
    if summary.stale:
        lines.append(("stale", f"{summary.stale} no longer what was made; run.json names them"))
    if summary.removed:
        lines.append(("removed", f"{summary.removed} outputs of earlier runs that belong to no image"))
    lines.append(("time", f"{summary.seconds:.2f} s ({rate:.1f} images/s)"))
    if summary.drive:
        lines.append(("map", _map_told(summary.drive)))
    good = [row for row in rows if row["status"] == "ok"]
    if good:
        parts = ("decode_ms", "edges_ms", "evolve_ms", "write_ms", "total_ms")
        medians = (f"{part[:-3]} {median(row[part] for row in good):.1f}" for part in parts)
        lines.append(("median ms", ", ".join(medians)))
    figures = _figures(good)
    if figures["doubts"]:
        doubts = (f"{count} {DOUBTS.get(name, name)}" for name, count in figures["doubts"].items())
        lines.append(("doubtful", f"{', '.join(doubts)}; of {len(good)}"))
    flicker, moved, overlaps = (
        [row[name] for row in good if row.get(name) is not None] for name in ("flicker", "steady_px", "iou")
    )
    if flicker:
        cost = f"; the past changed {sum(moved) / len(moved):.0f} px a frame" if moved else ""
        lines.append(("flicker", f"{sum(flicker) / len(flicker):.4f} (most {max(flicker):.4f}){cost}"))
    if overlaps:
        lines.append(("mean IoU", f"{figures['mean_iou']:.4f} (lowest {min(overlaps):.4f}, of {len(overlaps)})"))
    return lines


_MAX_REASONS = 5
"""Reasons said; the column ``note`` of ``timings.csv`` has one for each image."""


def nothing_tested(rows: Sequence[Mapping[str, Any]], out: str) -> list[str]:
    """Lines for people: how much stayed untested and why, by number of images; none when something was tested.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of ``timings.csv`` of the finished images.
    out : str
        Output folder, with ``obstacles.csv``.
    """
    if all(row.get("obstacles_ms") is None for row in rows):  # no camera: a table of verdicts is of an earlier run
        return []
    verdicts, images = _verdicts(os.path.join(out, "obstacles.csv"))
    if not verdicts or set(verdicts) != {"untested"}:
        return []
    notes = [row["note"] for row in rows if row.get("note") and row["image"] in images]
    components, of = counted(verdicts.total(), "enclosed component"), counted(len(images), "image")
    head = f"nothing was tested: {components} of {of} stay untested"
    return [head, *_reasons(notes, "image")]


def untested_pairs(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Lines for people: how many of the pairs could not be tested and why; none when all were."""
    pairs = [row for row in rows if row.get("pair") in ("tested", "untested")]
    notes = [row["note"] for row in pairs if row["pair"] == "untested"]
    return [f"{len(notes)} of {counted(len(pairs), 'pair')} untested:", *_reasons(notes, "pair")] if notes else []


def motions(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Lines for people: what came of comparing each image with those before."""
    return [f"{row['image']}: {row['note']}" for row in rows if row.get("pair") and row.get("note")]


def _reasons(notes: Sequence[str], what: str) -> list[str]:
    """Why, by number: notes that differ in their figures only are one reason, said as the first has it."""
    examples: dict[str, str] = {}
    for note in notes:
        examples.setdefault(_alike(note), note)
    counts = Counter(map(_alike, notes)).most_common()
    lines = [f"  {counted(count, what)}: {examples[key]}" for key, count in counts[:_MAX_REASONS]]
    return [*lines, "  further reasons are in the column note of timings.csv"] if len(counts) > _MAX_REASONS else lines


def _verdicts(path: str) -> tuple[Counter[str], set[str]]:
    try:
        with Path(path).open(encoding="utf-8-sig", newline="") as file:
            rows = [(row["verdict"], row["image"]) for row in csv.DictReader(file)]
    except (OSError, KeyError, csv.Error):
        return Counter(), set()
    return Counter(verdict for verdict, _ in rows), {image for _, image in rows}


def _alike(note: str) -> str:
    """A note without its numbers: those of one reason are one."""
    return re.sub(r"\d+(\.\d+)?", "#", note)
