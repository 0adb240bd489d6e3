"""``ffseg run``: segment images, one by one or by the folder."""

from __future__ import annotations

import contextlib
import os
import sys
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ffseg.batch.workers.launch import Process, launch, take
from ffseg.cli import completion, console
from ffseg.cli.checks import (
    MOST_MEGABYTES,
    MOST_SECONDS,
    checked_params,
    folder_or_stdout,
    number,
    plugin_files,
    require_source,
    require_truth,
)
from ffseg.cli.commands.pipe import PIPE, pipe
from ffseg.cli.options import (
    AllowCode,
    Boxes,
    Config,
    Evidence,
    FillHoles,
    Label,
    Largest,
    MinArea,
    Outside,
    Settings,
    SomeInputs,
    Starts,
    TruthLabel,
    starts_file,
    with_prompts,
    with_selection,
)
from ffseg.errors import UsageError
from ffseg.io.films import is_film

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ffseg.batch.outputs.table import Products
    from ffseg.batch.plan.jobs import Plan
    from ffseg.batch.views import Views
    from ffseg.batch.workers.messages import Setup
    from ffseg.parameters import Parameters

PROCESSES = "inprocess" if sys.platform == "win32" else "processes"
"""The default of ``--executor``: worker processes are waited for with ``poll``, which Windows does not have."""
_MEGABYTE = 1 << 20


def run(  # noqa: PLR0913 - the options of the command
    context: typer.Context,
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="DIR",
            parser=folder_or_stdout,
            help="Folder for the outputs, made if absent; - for stdout.",
        ),
    ],
    inputs: SomeInputs = None,
    config: Config = None,
    settings: Settings = None,
    allow_code: AllowCode = False,
    starts: Starts = None,
    evidence: Evidence = None,
    outside: Outside = None,
    boxes: Boxes = None,
    largest: Largest = None,
    min_area: MinArea = None,
    fill_holes: FillHoles = None,
    label: Label = None,
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
    ] = PROCESSES,
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
            help="Also write coco, labelme, geojson, yolo files, svg (contours over the image), cutout (PNG with alpha).",
        ),
    ] = None,
    metric: Annotated[
        bool, typer.Option("--map", help="Write the free space in metres: of each image, and a map and graph of all.")
    ] = False,
    film_out: Annotated[
        str,
        typer.Option(
            "--film-out", metavar="LIST", help="Films of all frames, too: mask, overlay, cutout (with alpha)."
        ),
    ] = "",
    animate: Annotated[bool, typer.Option("--animate", help="Write a film and a film strip of each image.")] = False,
    report: Annotated[bool, typer.Option("--report", help="Write report.html, a page to look at it all.")] = False,
    film: Annotated[
        bool, typer.Option("--film", help="Animations and stacks of pages frame by frame, not only the first.")
    ] = False,
    steady: Annotated[
        bool, typer.Option("--steady", help="Film frames in order: start and outline follow the frame before.")
    ] = False,
    flicker: Annotated[
        bool, typer.Option("--flicker", help="Film frames in order: measure what changes beside motion.")
    ] = False,
    raw: Annotated[
        str,
        typer.Option(
            "--raw", metavar="WxH:LAYOUT", help="Pixels of INPUT -, if not Y4M: 800x600:bgr24, rgb24 or gray."
        ),
    ] = "",
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
    if PIPE in (*(inputs or ()), str(out)) or raw:
        raise typer.Exit(pipe(context))
    early = early_workers(inputs or (), jobs or cores()) if PROCESSES == "processes" and not dry_run else []
    from ffseg.batch.executors.base import Options
    from ffseg.batch.runner import Run
    from ffseg.batch.workers.messages import Setup
    from ffseg.cli.interruption import Interruption
    from ffseg.cli.reporting import Progress, show_result

    with contextlib.ExitStack() as cleanup:
        cleanup.callback(end, early)
        interruption = cleanup.enter_context(Interruption("run it again to go on"))
        require_truth(truth, truth_label)
        settings = with_selection(with_prompts(settings, outside, boxes), largest, min_area, fill_holes, label)
        params = checked_params(config, settings, allow_code=allow_code)
        require_source(params, evidence)
        products = read_products(export or (), pack, film_out, overlay=overlay, animate=animate)
        products = in_metres(products, camera, asked=metric)
        who = _executor(executor, dask)
        choice = InputOptions(tuple(inputs or ()), tuple(exclude or ()), keep_suffix, listed, nul, film, quiet)
        plan = with_maps(read_plan(choice, out, products, truth, starts, params), evidence, camera)
        plan, views = in_sequence(plan, read_views(camera, poses, pairs, plan, footprint), shard)
        setup = Setup(params=params, views=views, products=products, truth_label=truth_label, redirects=redirects)
        setup = limited(replace(setup, files=plugin_files(params)), max_pixels, memory)
        plan, setup, most = in_order(plan, setup, who, "steady" if steady else "flicker" * flicker)
        if dry_run:
            raise typer.Exit(show_preview(plan, setup, overwrite=overwrite, as_json=as_json))
        progress = Progress(len(plan.jobs), bar=not quiet, verbose=verbose and not quiet, quiet=quiet)
        cleanup.callback(progress.close)
        options = Options(most or jobs or cores(), timeout, overwrite, report, read_tables(table), who, dask, chunk)
        work = cleanup.enter_context(Run(plan, setup, options, interruption, progress))
        interruption.defer()
        summary = work.execute(early)
        progress.close()
        if as_json or not quiet:
            show_result(work, plan.out, as_json=as_json, verbose=verbose)
        if summary.signal:
            raise typer.Exit(interruption.exit_code)
    if summary.failed or summary.problems:
        raise typer.Exit(console.FAILED_IMAGES)


def in_order(plan: Plan, setup: Setup, who: str, past: str) -> tuple[Plan, Setup, int]:
    """Plan and setup of a run whose frames need the ones before, and the most workers: one; 0 for any number.

    Raises
    ------
    UsageError
        For what cannot go in order.
    """
    if not past:
        return plan, setup, 0
    option = f"--{past}"
    refused = {
        "--shard": plan.shard,
        "--camera": setup.views,
        "--pack": plan.products.pack,
        "--dask": who == "dask",
    }
    other = next((name for name, there in refused.items() if there), "")
    if other:
        raise UsageError(
            f"{option} and {other} do not go together: every frame needs the one before it; run each film by itself"
        )
    from ffseg.batch.plan.jobs import with_past

    return with_past(plan), replace(setup, past=past), 1


def limited(setup: Setup, max_pixels: int, megabytes: int) -> Setup:
    """A setup with limits of an image and of a worker."""
    return replace(setup, max_pixels=max_pixels, memory_bytes=megabytes * _MEGABYTE)


def _executor(name: str, scheduler: str) -> str:
    """Who works on the images; refuses a name that nobody has."""
    from ffseg.plugins import check

    check("executors", name)
    return "dask" if scheduler else name


def show_preview(plan: Plan, setup: Setup, *, overwrite: bool, as_json: bool) -> int:
    """Show what a run would do; its exit code as far as that is known."""
    from ffseg.batch.preview import preview
    from ffseg.cli.reporting import show_plan

    return 0 if show_plan(preview(plan, setup, overwrite=overwrite), plan, as_json=as_json) else console.FAILED_IMAGES


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
    """The part of a plan that a shard does; all of it without one.

    Raises
    ------
    UsageError
        If there is no such part, or it is to be made a film.
    """
    if shard and plan.products.films:
        raise UsageError(
            "--film-out and --shard do not go together; merge the shards, then run it once more without --shard"
        )
    from ffseg.batch.shards.assign import only, read_shard

    return only(plan, read_shard(shard)) if shard else plan


def read_products(
    export: Sequence[str], pack: str = "", film_out: str = "", *, overlay: bool, animate: bool
) -> Products:
    """Outputs that are asked for.

    Raises
    ------
    UsageError
        For a format that does not exist, or a film without Pillow.
    """
    from ffseg.batch.outputs.table import Products, read_exports, read_pack

    if animate and find_spec("PIL") is None:
        raise UsageError("--animate needs Pillow; install it with: pip install 'ffseg[film]'")
    films: tuple[str, ...] = ()
    if film_out:
        from ffseg.batch.record.films import read_film_kinds

        films = read_film_kinds(film_out)
    overlay = overlay or "overlay" in films
    return Products(overlay, read_exports(export), animate, pack=read_pack(pack), films=films)


@dataclass(frozen=True, slots=True)
class InputOptions:
    """Which images are to be run, and how their outputs are named."""

    inputs: tuple[str, ...]
    exclude: tuple[str, ...]
    keep_suffix: bool
    listed: str = ""
    nul: bool = False
    film: bool = False
    quiet: bool = False


def in_metres(products: Products, camera: Path | None, *, asked: bool) -> Products:
    """The outputs with those in metres, where they are asked for.

    Raises
    ------
    UsageError
        Without a camera.
    """
    if asked and camera is None:
        raise UsageError("--map needs --camera, which knows how large the ground is; name the camera file")
    return replace(products, metric=asked)


def read_plan(
    choice: InputOptions, out: Path, products: Products, truth: Path | None, starts: Path | None, params: Parameters
) -> Plan:
    """Images of a run with their outputs, truths, starts and domains."""
    from ffseg.batch.plan.jobs import make_plan, with_domains, with_starts
    from ffseg.batch.plan.listing import listed
    from ffseg.cli.reporting import show_skipped, show_without_start
    from ffseg.io.starts import finds_starts

    starting, domains = starts_file(starts, params), params.domain.masks

    if not choice.inputs and not choice.listed:
        raise UsageError("there is no input; name image files, folders or patterns, or a list with --list FILE")
    named = listed(choice.listed, nul=choice.nul) if choice.listed else ()
    plan = make_plan(
        [*named, *choice.inputs],
        os.fspath(out),
        film=choice.film,
        products=products,
        truth=os.fspath(truth) if truth else "",
        exclude=choice.exclude,
        keep_suffix=choice.keep_suffix,
    )
    show_skipped(plan, quiet=choice.quiet)
    plan = with_starts(plan, starting, partial=finds_starts(params)) if starting else plan
    if starting and not choice.quiet:
        show_without_start(plan, starting)
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
    several = jobs > 1 and (len(inputs) != 1 or os.path.isdir(inputs[0]) or is_film(inputs[0]))
    early: list[Process] = []
    with contextlib.suppress(OSError):  # no more descriptors or processes: the run says so itself
        early.append(take())
        early += [launch()] if several else []
    return early


def end(processes: Sequence[Process]) -> None:
    """End workers, also those that a run has taken over and ended."""
    for process in processes:
        process.end()


def cores() -> int:
    """Cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
