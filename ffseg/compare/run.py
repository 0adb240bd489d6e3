"""Several methods on the same images: times, agreement with truth, the paper's table."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import astuple, replace
from math import floor
from statistics import median
from time import perf_counter

from ffseg.arrays import Image
from ffseg.batch.plan.jobs import make_plan, with_domains, with_evidence, with_starts
from ffseg.batch.plan.sources import STATE_FOLDER, Job
from ffseg.batch.record.lock import OutputLock
from ffseg.batch.workers.pictures import read_evidence, read_source, read_truth
from ffseg.compare.journal import PAGE, TABLE, Journal, panel_of, refuse_foreign
from ffseg.compare.shared import SharedInput, shared_input, was_moved
from ffseg.compare.text import markdown
from ffseg.compare.values import COLUMNS, Comparison, Row
from ffseg.errors import FfsegError, ImageReadError, OutputError, ParameterError, UsageError, is_out_of_memory
from ffseg.io.files import SKIP_FILE, make_folder, printable, remove_files, write_all_atomic, write_bytes_atomic
from ffseg.io.images import prepare_worker
from ffseg.io.masks import Masks, named_masks
from ffseg.io.overlays import polylines
from ffseg.io.panels import Tile, encode_panel
from ffseg.io.tables import csv_table
from ffseg.methods.peers import method_parameters
from ffseg.metrics import scores
from ffseg.peer_parameters import PeerParameters
from ffseg.pipeline import segment
from ffseg.plugins import described
from ffseg.plugins import method as row_of
from ffseg.result import Segmentation
from ffseg.scene import Scene

NO_MEMORY = "out-of-memory: there is not enough memory for it; scale it down"
_MAX_ERROR_LENGTH = 300


def plan_comparison(
    inputs: Sequence[str], out: str, truth: str = "", starts: str = "", evidence: str = "", domains: str = ""
) -> tuple[Job, ...]:
    """Images to compare on, each with its truth, start circle, map of evidence and domain out of files and folders.

    Raises
    ------
    UsageError
        If an input is missing, two share a name, or an output would replace an input or what no comparison made.
    ParameterError
        If the starts file is wrong, or has no row for an image.
    """
    plan = make_plan(inputs, out, truth=truth)
    plan = with_starts(plan, starts) if starts else plan
    plan = with_domains(plan, domains) if domains else plan
    jobs = (with_evidence(plan, evidence) if evidence else plan).jobs
    taken = {os.path.realpath(path) for job in jobs for path in (job.source.path, job.truth) if path}
    panels = [panel_of(out, job.source.name) for job in jobs if not job.source.problem]
    for panel in panels:
        if os.path.realpath(panel) in taken:
            raise UsageError(f"the output {printable(panel)} would replace an input image; choose another folder")
    refuse_foreign(out, panels)
    return jobs


def compare(
    task: Comparison, tell: Callable[[Row], None], pace: Callable[[int, float], None] | None = None
) -> list[Row]:
    """Run every method on every image and write ``compare.csv``, ``compare.md`` and ``panels/``.

    The tables are also written when it is interrupted; the same comparison then goes on with the images that are left.

    Parameters
    ----------
    tell : callable
        Called with each row when it is known.
    pace : callable, optional
        Called with the number of images that are done and the seconds that the others will take.

    Returns
    -------
    list of Row
        Image by image, methods in the order asked for.

    Raises
    ------
    ParameterError
        If a mask file that the parameters name cannot be read.
    UsageError
        If another comparison is writing into the folder.
    OutputError
        If an output cannot be written.
    """
    prepare_worker()
    panels = os.path.join(task.out, "panels")
    with OutputLock(task.out, os.path.join(panels, STATE_FOLDER)):
        write_bytes_atomic(os.path.join(panels, SKIP_FILE), b"")  # they are no inputs of what walks the folders above
        return _compare(task, tell, pace)


def _compare(task: Comparison, tell: Callable[[Row], None], pace: Callable[[int, float], None] | None) -> list[Row]:
    masks = named_masks(task.params)
    rows: list[Row] = []
    journal, begin, known = Journal(task), perf_counter(), 0
    with _tables(task, rows):
        for number, job in enumerate(task.jobs, start=1):
            key, panel = journal.key(job), panel_of(task.out, job.source.name)
            made = journal.rows(key) if os.path.isfile(panel) else []
            known += bool(made)
            if not made:
                made, panel = _compare_image(task, job, masks, tell)
                journal.add(key, made)
            rows += made
            journal.panels.discard(panel)
            if pace is not None and number > known:
                pace(number, (perf_counter() - begin) / (number - known) * (len(task.jobs) - number))
    remove_files(journal.panels)  # panels of images that are not compared any more, or could not be read
    journal.end()
    return rows


@contextmanager
def _tables(task: Comparison, rows: Sequence[Row]) -> Iterator[None]:
    """Write the tables of the rows that the block has added, also when it is interrupted."""
    try:
        try:
            yield
        finally:
            tables = {TABLE: table(rows), PAGE: markdown(task, rows).encode("utf-8")}
            write_all_atomic([(os.path.join(task.out, name), content) for name, content in tables.items()])
    except OutputError as error:
        error.exit_code = 3  # not 2: something was run
        raise


def table(rows: Iterable[Row]) -> bytes:
    """CSV of all rows."""
    return csv_table(COLUMNS, map(astuple, rows))


def missed_gates(rows: Sequence[Row], gates: dict[str, float]) -> list[str]:
    """One sentence for each method whose IoU lies below its gate on an image, or is not known there.

    Parameters
    ----------
    gates : dict of float
        Least IoU by method; the empty name stands for every method that was run.
    """
    missed = []
    for row in rows:
        gate = gates.get(row.method, gates.get(""))
        if gate is None or (row.status == "skipped" and row.method not in gates):
            continue
        if row.iou is None:
            missed.append(f"{row.image}: {row.method} has no IoU, the gate is {gate:g}")
        elif row.iou < gate:
            missed.append(
                f"{row.image}: {row.method} has IoU {floor(round(row.iou * 1e4, 6)) / 1e4:.4f}, the gate is {gate:g}"
            )
    return missed


def _compare_image(task: Comparison, job: Job, masks: Masks, tell: Callable[[Row], None]) -> tuple[list[Row], str]:
    """Rows of one image, and its panel, which is written; empty where the image cannot be read."""
    name = printable(job.source.name)
    try:
        image = read_source(job.source, levels=task.params.input.range)
        height, width = image.shape[:2]
        truth = read_truth(job.truth, (height, width), task.truth_label) if job.truth else None
        evidence = read_evidence(job.evidence) if job.evidence else None
        bounds = masks.within(job.domain).bounds
    except (ImageReadError, ParameterError, MemoryError) as error:
        rows = [Row(name, method, status="failed", error=_failure(error)) for method in task.methods]
        for row in rows:
            tell(row)
        return rows, ""
    params = job.start.placed(task.params, image.shape) if job.start else task.params
    scene = Scene(image, params, evidence=evidence, **bounds)
    # Method after method in every round, so that whatever else the machine does falls on all alike.
    rounds = []
    for _ in range(task.repeat):
        alike = None if task.own_edges else shared_input(scene, task.methods)
        rounds.append([_run(scene, Row(name, method), task.peers, alike) for method in task.methods])
    rows, tiles = [], []
    for runs in zip(*rounds, strict=True):
        row, result = _middle(runs)
        row = row if result is None else _scored(row, result, truth)
        tell(row)
        rows.append(row)
        tiles.append(_tile(row, result))
    panel = panel_of(task.out, job.source.name)
    make_folder(os.path.dirname(panel))
    write_bytes_atomic(panel, encode_panel(image, tiles))
    return rows, panel


def _failure(error: Exception) -> str:
    """Reason and sentence of what failed, as of a run."""
    if isinstance(error, FfsegError):
        return f"{error.reason}: {error}"
    return NO_MEMORY if is_out_of_memory(error) else f"internal: {described(error)}"


_Run = tuple[Row, Segmentation | None]


def _run(scene: Scene, row: Row, peers: PeerParameters, alike: SharedInput | None) -> _Run:
    """Run a method once: its row without scores, and its result if it has one."""
    chosen = row_of(row.method)
    if not chosen.installed:
        return replace(
            row, status="skipped", error=f"the package {chosen.package} is not installed; add ffseg[peers]"
        ), None
    try:
        params, options = method_parameters(scene.params, row.method, peers)
        one = replace(scene, params=params, method=chosen, options=options)
        result = segment(one if alike is None else alike.scene(one))
    except Exception as error:  # noqa: BLE001 - a package may raise anything; the others are compared all the same
        text = " ".join(_failure(error).split())[:_MAX_ERROR_LENGTH]
        return replace(row, status="failed", error=text), None
    times = {key: getattr(result.timings, key) for key in _TIMES}
    if alike is not None and chosen.uses_edges:  # it would have had to make them
        times |= {key: times[key] + alike.edges_ms for key in ("edges_ms", "total_ms")}
    counts = {} if chosen.module else {key: getattr(result.stats, key) for key in _COUNTS}
    moved = was_moved(result.messages) or (alike is not None and alike.moved)
    row = replace(row, source=alike.edges.source if alike else result.source, start_moved="yes" if moved else "no")
    return replace(row, **times, **counts), result


_TIMES = ("edges_ms", "evolve_ms", "total_ms")
_COUNTS = ("initial_points", "final_points", "iterations")


def _middle(runs: Sequence[_Run]) -> _Run:
    """Last run with the median times of all, or the first run that failed."""
    broken = next((run for run in runs if run[1] is None), None)
    if broken is not None:
        return broken
    times = {key: round(median(getattr(row, key) for row, _ in runs), 3) for key in _TIMES}
    row, result = runs[-1]
    return replace(row, **times), result


def _scored(row: Row, result: Segmentation, truth: Image | None) -> Row:
    row = replace(row, holes=result.num_holes)
    if truth is None:
        return row
    found = scores(result.mask, truth)
    return replace(
        row,
        iou=found.iou,
        boundary_mean_px=found.boundary_mean,
        boundary_max_px=found.boundary_max,
        boundary_f_2px=found.boundary_f,
    )


def _tile(row: Row, result: Segmentation | None) -> Tile:
    if result is None:
        return Tile(f"{row.method}: {row.status}", None, ())
    lines = polylines(result.contours)
    label = f"{row.method}  {row.evolve_ms:.1f} ms" + ("" if row.iou is None else f"  IoU {row.iou:.4f}")
    return Tile(label, result.mask, lines)
