"""``ffseg run``: segment images, one by one or by the folder."""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ffseg.batch.workers.launch import Process, launch, take
from ffseg.cli import completion
from ffseg.cli.checks import (
    MOST_MEGABYTES,
    MOST_SECONDS,
    checked_params,
    number,
    plugin_files,
    require_source,
    require_truth,
)
from ffseg.cli.options import (
    AllowCode,
    Config,
    Evidence,
    FillHoles,
    Largest,
    MinArea,
    Out,
    Outside,
    Settings,
    SomeInputs,
    Starts,
    TruthLabel,
    starts_file,
    with_background,
    with_selection,
)
from ffseg.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ffseg.batch.outputs.table import Wanted
    from ffseg.batch.plan.jobs import Plan
    from ffseg.batch.views import Views
    from ffseg.batch.workers.messages import Setup
    from ffseg.parameters import Parameters

FAILED_IMAGES = 3
"""Exit code when at least one image failed."""
_MEGABYTE = 1 << 20


def run(  # noqa: PLR0913 - the options of the command
    out: Out,
    inputs: SomeInputs = None,
    config: Config = None,
    settings: Settings = None,
    allow_code: AllowCode = False,
    starts: Starts = None,
    evidence: Evidence = None,
    outside: Outside = None,
    largest: Largest = None,
    min_area: MinArea = None,
    fill_holes: FillHoles = None,
    camera: Annotated[
        Path | None, typer.Option("--camera", metavar="FILE", help="Camera file: tests enclosed components on pairs.")
    ] = None,
    poses: Annotated[
        Path | None, typer.Option("--poses", metavar="FILE", help="Poses CSV or TUM trajectory; else from the ground.")
    ] = None,
    pairs: Annotated[
        Path | None, typer.Option("--pairs", metavar="FILE", help="CSV previous,current; else neighbours in a folder.")
    ] = None,
    footprint: Annotated[
        float | None,
        typer.Option(
            "--footprint",
            metavar="R",
            min=0,
            max=100,
            callback=number,
            help="Metres: passages that a robot of this radius cannot take count as closed.",
        ),
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option("--truth", metavar="DIR", help="Folder or .tar of true masks (NAME.png): adds the IoU."),
    ] = None,
    truth_label: TruthLabel = None,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=0, help="Worker processes; 0 = one for each core.")] = 0,
    executor: Annotated[
        str,
        typer.Option("--executor", metavar="NAME", help="Who works: processes, dask, inprocess to debug, or your own."),
    ] = "processes",
    dask: Annotated[
        str, typer.Option("--dask", metavar="ADDRESS", help="Scheduler of a Dask cluster; else one is started here.")
    ] = "",
    chunk: Annotated[int, typer.Option("--chunk", min=1, max=10_000, help="Images a Dask worker gets at once.")] = 500,
    pack: Annotated[
        str,
        typer.Option("--pack", metavar="tar", help="Outputs go into tar files, one a kind, instead of a file each."),
    ] = "",
    shard: Annotated[
        str, typer.Option("--shard", metavar="i/n", help="Only this part of the images; 'ffseg merge' joins them.")
    ] = "",
    table: Annotated[
        str,
        typer.Option("--table", metavar="LIST", help="Tables to write: csv, or csv,parquet for timings.parquet too."),
    ] = "csv",
    overlay: Annotated[
        bool, typer.Option("--overlay/--no-overlay", help="Write images with the contours drawn.")
    ] = False,
    export: Annotated[
        list[str] | None,
        typer.Option(
            "--export",
            metavar="LIST",
            autocompletion=completion.exports,
            help="Also write coco, labelme, geojson files, or svg: the contours over the image.",
        ),
    ] = None,
    metric: Annotated[
        bool, typer.Option("--map", help="Write the free space in metres: ground, scans, pictures from above.")
    ] = False,
    animate: Annotated[bool, typer.Option("--animate", help="Write a film and a film strip of each image.")] = False,
    report: Annotated[bool, typer.Option("--report", help="Write report.html, a page to look at it all.")] = False,
    exclude: Annotated[
        list[str] | None, typer.Option("--exclude", metavar="PATTERN", help="Leave out what matches; may be repeated.")
    ] = None,
    listed: Annotated[
        str, typer.Option("--list", metavar="FILE", help="File with one image path a line; - for stdin.")
    ] = "",
    nul: Annotated[bool, typer.Option("-0", help="Paths of --list end with NUL, as of find -print0.")] = False,
    redirects: Annotated[
        bool, typer.Option("--follow-redirects", help="HTTP inputs may lead to other hosts than the one named.")
    ] = False,
    keep_suffix: Annotated[
        bool, typer.Option("--keep-suffix", help="Outputs of a.jpg are called a.jpg.png, ... instead of a.png.")
    ] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Do everything again, whatever is there.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Show what would be done and write nothing.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document instead of the table.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress, no table; errors only.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="A line for each image.")] = False,
    timeout: Annotated[
        float,
        typer.Option(
            "--timeout",
            min=0,
            max=MOST_SECONDS,
            callback=number,
            show_default=True,
            help="Seconds an image may take; 0 = no limit.",
        ),
    ] = 300.0,
    memory: Annotated[
        int, typer.Option("--memory", min=0, max=MOST_MEGABYTES, help="MB a worker may add to its start; 0 = no limit.")
    ] = 4096,
    max_pixels: Annotated[int, typer.Option("--max-pixels", min=1, help="Refuse larger images.")] = 100_000_000,
) -> None:
    """Segment images: masks, exact contours, a table of timings and what went wrong.

    A second run into the same folder does only what is missing or stale. Exit code: 0 every image done; 2 nothing was
    run; 3 at least one image failed, the others are written.
    """
    early = early_workers(inputs or (), jobs or cores()) if not dry_run else []
    from ffseg.batch.executors.base import Choice
    from ffseg.batch.runner import Options, Run
    from ffseg.batch.workers.messages import Setup
    from ffseg.cli.interruption import Interruption
    from ffseg.cli.reporting import Progress, show_result
    from ffseg.plugins import check

    with contextlib.ExitStack() as cleanup:
        for process in early:
            cleanup.callback(process.end)
        interruption = cleanup.enter_context(Interruption("run it again to go on"))
        require_truth(truth, truth_label)
        settings = with_selection(with_background(settings, outside), largest, min_area, fill_holes)
        params = checked_params(config, settings, allow_code=allow_code)
        require_source(params, evidence)
        wanted = in_metres(read_wanted(export or (), pack, overlay=overlay, animate=animate), camera, asked=metric)
        choice = Chosen(tuple(inputs or ()), tuple(exclude or ()), keep_suffix, listed, nul)
        plan = with_maps(read_plan(choice, out, wanted, truth, starts, params), evidence, camera)
        plan, views = in_sequence(plan, read_views(camera, poses, pairs, plan, footprint), shard)
        check("executors", executor)
        setup = Setup(params=params, views=views, wanted=wanted, truth_label=truth_label, files=plugin_files(params))
        setup = limited(replace(setup, redirects=redirects), max_pixels, memory)
        if dry_run:
            raise typer.Exit(show_preview(plan, setup, overwrite=overwrite, as_json=as_json))
        progress = Progress(len(plan.jobs), bar=not quiet, verbose=verbose and not quiet, quiet=quiet)
        cleanup.callback(progress.close)
        who = Choice("dask" if dask else executor, dask, chunk)
        options = Options(jobs or cores(), timeout, overwrite, report, who, read_tables(table))
        work = cleanup.enter_context(Run(plan, setup, options, interruption, progress))
        interruption.defer()
        summary = work.execute(early)
        progress.close()
        if as_json or not quiet:
            show_result(work, plan.out, as_json=as_json, verbose=verbose)
        if summary.signal:
            raise typer.Exit(interruption.exit_code)
    if summary.failed or summary.problems:
        raise typer.Exit(FAILED_IMAGES)


def limited(setup: Setup, max_pixels: int, megabytes: int) -> Setup:
    """A setup with limits of an image and of a worker."""
    return replace(setup, max_pixels=max_pixels, memory_bytes=megabytes * _MEGABYTE)


def show_preview(plan: Plan, setup: Setup, *, overwrite: bool, as_json: bool) -> int:
    """Show what a run would do; its exit code as far as that is known."""
    from ffseg.batch.preview import preview
    from ffseg.cli.reporting import show_plan

    return 0 if show_plan(preview(plan, setup, overwrite=overwrite), plan, as_json=as_json) else FAILED_IMAGES


def read_tables(text: str) -> bool:
    """Whether a Parquet table is asked for.

    Raises
    ------
    UsageError
        For a format that does not exist, or cannot be written.
    """
    names = {name.strip().lower() for name in text.split(",")}
    if not names <= {"csv", "parquet"}:
        raise UsageError(f"--table {text!r}: there is no such table; choose from csv, parquet")
    if "parquet" in names:
        from ffseg.batch.outputs.parquet import require_parquet

        require_parquet()
    return "parquet" in names


def part_of(plan: Plan, shard: str) -> Plan:
    """The part of a plan that a shard does; all of it without one."""
    from ffseg.batch.shards.assign import only, read_shard

    return only(plan, read_shard(shard)) if shard else plan


def read_wanted(export: Sequence[str], pack: str = "", *, overlay: bool, animate: bool) -> Wanted:
    """Outputs that are asked for.

    Raises
    ------
    UsageError
        For a format that does not exist, or a film without Pillow.
    """
    from ffseg.batch.outputs.table import Wanted, read_exports, read_pack

    if animate and find_spec("PIL") is None:
        raise UsageError("--animate needs Pillow; install it with: pip install 'ffseg[film]'")
    return Wanted(overlay, read_exports(export), animate, pack=read_pack(pack))


@dataclass(frozen=True, slots=True)
class Chosen:
    """Which images are to be run, and how their outputs are named."""

    inputs: tuple[str, ...]
    exclude: tuple[str, ...]
    keep_suffix: bool
    listed: str = ""
    nul: bool = False


def in_metres(wanted: Wanted, camera: Path | None, *, asked: bool) -> Wanted:
    """The outputs with those in metres, where they are asked for.

    Raises
    ------
    UsageError
        Without a camera.
    """
    if asked and camera is None:
        raise UsageError("--map needs --camera, which knows how large the ground is; name the camera file")
    return replace(wanted, metric=asked)


def read_plan(
    choice: Chosen, out: Path, wanted: Wanted, truth: Path | None, starts: Path | None, params: Parameters
) -> Plan:
    """Images of a run with their outputs, truths, starts and domains."""
    from ffseg.batch.plan.jobs import make_plan, with_domains, with_starts
    from ffseg.batch.plan.listing import listed
    from ffseg.io.starts import finds_starts

    starting, domains = starts_file(starts, params), params.domain.masks

    if not choice.inputs and not choice.listed:
        raise UsageError("there is no input; name image files, folders or patterns, or a list with --list FILE")
    plan = make_plan(
        choice.inputs,
        os.fspath(out),
        wanted=wanted,
        truth=os.fspath(truth) if truth else "",
        exclude=choice.exclude,
        keep_suffix=choice.keep_suffix,
        listed=listed(choice.listed, nul=choice.nul) if choice.listed else (),
    )
    plan = with_starts(plan, starting, partial=finds_starts(params)) if starting else plan
    return with_domains(plan, domains) if domains else plan


def with_maps(plan: Plan, evidence: Path | None, camera: Path | None) -> Plan:
    """The plan with each image's map of evidence, if there are any.

    Raises
    ------
    UsageError
        With a camera, whose frames take none.
    """
    if evidence is None:
        return plan
    if camera is not None:
        raise UsageError(
            "--evidence and --camera do not go together: the images of a camera are segmented without maps; leave out one "
            "of them, or name the network or .ffmodel that made the maps as edges.model"
        )
    from ffseg.batch.plan.jobs import with_evidence

    return with_evidence(plan, os.fspath(evidence))


def in_sequence(plan: Plan, views: Views | None, shard: str) -> tuple[Plan, Views | None]:
    """The plan with the images before each image, if there is a camera, and what they came from."""
    from ffseg.batch.plan.jobs import with_earlier

    return part_of(with_earlier(plan, views.chain) if views else plan, shard), views


def read_views(
    camera: Path | None, poses: Path | None, pairs: Path | None, plan: Plan, footprint: float | None = None
) -> Views | None:
    """Camera, poses and pairs of a run; None without a camera.

    Raises
    ------
    UsageError
        For poses or pairs without a camera.
    CalibrationError
        For files that are wrong.
    """
    if camera is None:
        if poses or pairs or footprint is not None:
            raise UsageError("--poses, --pairs and --footprint need --camera; name the camera file")
        return None
    from ffseg.batch.views import load_views

    names = [job.source.name for job in plan.jobs]
    return load_views(
        os.fspath(camera), os.fspath(poses) if poses else None, os.fspath(pairs) if pairs else None, names, footprint
    )


def early_workers(inputs: Sequence[str], jobs: int) -> list[Process]:
    """Workers that load OpenCV while this process loads the rest, reads parameters and plans; two if there may be work."""
    several = jobs > 1 and (len(inputs) != 1 or os.path.isdir(inputs[0]))
    early: list[Process] = []
    with contextlib.suppress(OSError):  # no more descriptors or processes: the run says so itself
        early.append(take())
        early += [launch()] if several else []
    return early


def cores() -> int:
    """Cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
