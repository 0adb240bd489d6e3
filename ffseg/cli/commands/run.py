"""``ffseg run``: segment images, one by one or by the folder."""

from __future__ import annotations

import contextlib
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ffseg.batch.workers.launch import Process, cores, launch, take_process
from ffseg.cli import checks, completion, console, options
from ffseg.cli.commands.pipe import PIPE, pipe
from ffseg.cli.interruption import Interruption
from ffseg.errors import UsageError
from ffseg.io.films import is_film
from ffseg.plugins import require

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ffseg.batch.executors.base import Options
    from ffseg.batch.outputs.table import Products
    from ffseg.batch.plan.jobs import Plan
    from ffseg.batch.plan.sources import InputImage
    from ffseg.batch.views import CameraSetup
    from ffseg.batch.workers.messages import Setup
    from ffseg.parameters import Parameters

PROCESSES = "inprocess" if sys.platform == "win32" else "processes"
"""The default of ``--executor``: worker processes are waited for with ``poll``, which Windows does not have."""
_MEGABYTE = 1 << 20
_NEED = {
    **dict.fromkeys(
        ("poses", "pairs", "footprint"),
        ("camera", "--poses, --pairs and --footprint need --camera; name the camera file"),
    ),
    "metric": ("camera", "--map needs --camera, which knows how large the ground is; name the camera file"),
    "nul": ("listed", "-0 says how the paths of --list end; name a list"),
    "chunk": ("dask", "--chunk says how many images a Dask worker gets; name --executor dask or --dask ADDRESS"),
}
"""What options mean nothing without, and what is said of them."""
_APART = {
    ("film_out", "shard"): "; merge the shards, then run it once more without --shard",
    ("report", "shard"): "; 'ffseg merge DIR --report' writes the page of all shards",
    ("evidence", "camera"): ": the images of a camera are segmented without maps; leave out one of them, or name the "
    "network or .ffmodel that made the maps as edges.model",
    **{
        (past, other): ": every frame needs the one before it; leave out one of them"
        for past in ("steady", "flicker")
        for other in ("shard", "camera", "pack", "dask")
    },
}
"""What follows "do not go together" for two options, by their names."""


def run(  # noqa: PLR0913 - the options of the command
    context: typer.Context,
    out: Annotated[
        Path,
        typer.Option(
            metavar="DIR", parser=checks.folder_or_stdout, help="Folder for the outputs, made if absent; - for stdout."
        ),
    ],
    inputs: options.SomeInputs = None,
    config: options.Config = None,
    settings: options.Settings = None,
    allow_code: options.AllowCode = False,
    starts: options.Starts = None,
    evidence: options.Evidence = None,
    at: options.At = None,
    outside: options.Outside = None,
    boxes: options.Boxes = None,
    largest: options.Largest = None,
    min_area: options.MinArea = None,
    fill_holes: options.FillHoles = None,
    label: options.Label = None,
    camera: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Camera file: tests enclosed components on pairs.")
    ] = None,
    poses: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Poses CSV or TUM trajectory; else from the ground.")
    ] = None,
    pairs: Annotated[
        Path | None, typer.Option(metavar="FILE", help="CSV previous,current; else neighbours in a folder.")
    ] = None,
    footprint: Annotated[
        float | None,
        typer.Option(
            metavar="R",
            min=0,
            max=100,
            callback=checks.number,
            help="Metres: passages that a robot of this radius cannot take count as closed.",
        ),
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder or .tar of true masks (NAME.png): adds the IoU."),
    ] = None,
    truth_label: options.TruthLabel = None,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=0, help="Worker processes; 0 = one for each core.")] = 0,
    executor: Annotated[
        str,
        typer.Option(metavar="NAME", help="Who works: processes, dask, inprocess to debug, or your own."),
    ] = PROCESSES,
    dask: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Scheduler of a Dask cluster; else one is started here.")
    ] = "",
    chunk: Annotated[
        int | None,
        typer.Option(min=1, max=10_000, show_default="500", help="Images a Dask worker gets at once."),
    ] = None,
    pack: Annotated[
        str,
        typer.Option(metavar="tar", help="Outputs go into tar files, one a kind, instead of a file each."),
    ] = "",
    shard: Annotated[
        str, typer.Option(metavar="i/n", help="Only this part of the images; 'ffseg merge' joins them.")
    ] = "",
    table: options.Table = "csv",
    overlay: Annotated[
        bool, typer.Option("--overlay/--no-overlay", help="Write images with the contours drawn.")
    ] = False,
    export: Annotated[
        list[str] | None,
        typer.Option(
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
        typer.Option(metavar="LIST", help="Films of all frames, too: mask, overlay, cutout (with alpha)."),
    ] = "",
    animate: Annotated[bool, typer.Option("--animate", help="Write a film and a film strip of each image.")] = False,
    report: options.Report = False,
    film: Annotated[
        bool, typer.Option("--film", help="Animations and stacks of pages frame by frame, not only the first.")
    ] = False,
    bag: Annotated[
        str,
        typer.Option(metavar="FILE", help="Bag of ROS 1 or 2 whose --topic holds the images; --poses may name one."),
    ] = "",
    topic: Annotated[str, typer.Option(metavar="NAME", help="Topic of the images in --bag.")] = "",
    steady: Annotated[
        bool, typer.Option("--steady", help="Film frames in order: starts and outline follow the frame before.")
    ] = False,
    flicker: Annotated[
        bool, typer.Option("--flicker", help="Film frames in order: measure what changes beside motion.")
    ] = False,
    raw: Annotated[
        str,
        typer.Option(metavar="WxH:LAYOUT", help="Pixels of INPUT -, if not Y4M: 800x600:bgr24, rgb24 or gray."),
    ] = "",
    exclude: Annotated[
        list[str] | None, typer.Option(metavar="PATTERN", help="Leave out what matches; may be repeated.")
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
    as_json: options.AsJson = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress, no table; errors only.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="A line for each image.")] = False,
    timeout: Annotated[
        float,
        typer.Option(
            min=0,
            max=checks.MAX_SECONDS,
            callback=checks.number,
            show_default=True,
            help="Seconds an image may take; 0 = no limit.",
        ),
    ] = 300.0,
    memory: Annotated[
        int,
        typer.Option(min=0, max=checks.MAX_MEGABYTES, help="MB a worker may add to its start; 0 = no limit."),
    ] = 4096,
    max_pixels: Annotated[int, typer.Option(min=1, help="Refuse larger images.")] = 100_000_000,
) -> None:
    """Segment images: masks, exact contours, a table of timings and what went wrong.

    A second run into the same folder does only what is missing or stale. Exit code: 0 every image done; 2 nothing was
    run; 3 at least one image failed, the others are written.
    """
    if PIPE in (*(inputs or ()), str(out)) or raw:
        raise typer.Exit(pipe(context))
    workers = 1 if steady or flicker else jobs or cores()
    with contextlib.ExitStack() as cleanup:
        early = _early_workers(inputs or (), workers) if PROCESSES == "processes" and not dry_run else []
        for process in early:  # also those that the run takes over and ends
            cleanup.callback(process.end)
        from ffseg.batch.executors.base import Options
        from ffseg.batch.plan.jobs import make_plan
        from ffseg.batch.runner import Run
        from ffseg.batch.workers.messages import Setup
        from ffseg.cli.reporting import ProgressBar, show_result

        interruption = cleanup.enter_context(Interruption())
        params = checks.ready_params(config, options.overrides(context.params), evidence, allow_code=allow_code)
        who = _executor(executor, dask, context.params)
        products = _products(export or (), pack, film_out, overlay=overlay, animate=animate, metric=metric)
        named: dict[str, Any] = {"truth": os.fspath(truth or ""), "exclude": exclude or (), "keep_suffix": keep_suffix}
        found = _inputs(inputs or (), listed, (bag, topic), nul=nul)
        plan = make_plan(found, os.fspath(out), film=film, products=products, **named)
        plan = _with_files(plan, params, options.starts_file(starts, params), os.fspath(evidence or ""), quiet=quiet)
        views = _views(plan, camera, poses, pairs, footprint) if camera else None
        setup = Setup(params=params, views=views, products=products, files=checks.plugin_files(params))
        setup = replace(setup, truth_label=truth_label, redirects=redirects, max_pixels=max_pixels)
        setup = replace(setup, memory_bytes=memory * _MEGABYTE, past="steady" if steady else "flicker" * flicker)
        plan = _ordered(plan, setup, shard, told="" if quiet else os.fspath(starts or ""))
        how = Options(workers, timeout, overwrite, report, read_tables(table), who, dask, chunk or 500)
        if dry_run:
            raise typer.Exit(_preview(plan, setup, how, as_json=as_json))
        progress = ProgressBar(len(plan.jobs), bar=not quiet, verbose=verbose and not quiet, quiet=quiet)
        cleanup.callback(progress.close)
        work = cleanup.enter_context(Run(plan, setup, how, interruption, progress))
        interruption.defer()
        summary = work.execute(early)
        progress.close()
        if as_json or not quiet:
            show_result(work, plan.out, as_json=as_json, verbose=verbose)
    failed = console.FAILED_IMAGES if summary.failed or summary.problems else 0
    raise typer.Exit(interruption.exit_code if summary.signal else failed)


def _require_together(arguments: Mapping[str, Any]) -> None:
    """Refuse options that need others, or do not go with them."""
    checks.require_truth(arguments["truth"], arguments["truth_label"])
    named = {name for name, value in arguments.items() if not (value is None or value is False or value in ("", ()))}
    for name, (other, sentence) in _NEED.items():
        if name in named and other not in named:
            raise UsageError(sentence)
    for pair, why in _APART.items():
        if named.issuperset(pair):
            one, other = (name.replace("_", "-") for name in pair)
            raise UsageError(f"--{one} and --{other} do not go together{why}")


def _executor(name: str, scheduler: str, arguments: Mapping[str, Any]) -> str:
    """Who works on the images, once all that is asked for goes together."""
    from ffseg.plugins import check

    check("executors", name)
    if scheduler and name not in (PROCESSES, "dask"):
        raise UsageError(f"--dask is of the executor dask, not of {name}; leave one of them out")
    who = "dask" if scheduler else name
    _require_together({**arguments, "dask": who == "dask"})
    return who


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
        require("pyarrow", "--table parquet needs pyarrow", "parquet")
    return "parquet" in names


def _products(
    export: Sequence[str], pack: str, film_out: str, *, overlay: bool, animate: bool, metric: bool
) -> Products:
    from ffseg.batch.outputs.table import Products, read_exports, read_pack

    if animate:
        require("PIL", "--animate needs Pillow", "film")
    films: tuple[str, ...] = ()
    if film_out:
        from ffseg.batch.record.films import read_film_kinds

        films = read_film_kinds(film_out)
    return Products(overlay or "overlay" in films, read_exports(export), animate, read_pack(pack), metric, films)


def _inputs(inputs: Sequence[str], listing: str, bag: tuple[str, str], *, nul: bool) -> list[str | InputImage]:
    from ffseg.batch.plan.discover import bag_frames, sources_of_list

    if not inputs and not listing and not any(bag):
        raise UsageError("there is no input; name image files, folders or patterns, or a list with --list FILE")
    framed = bag_frames(*bag) if any(bag) else ()
    return [*(sources_of_list(listing, nul=nul) if listing else ()), *inputs, *framed]


def _with_files(plan: Plan, params: Parameters, starts: str, evidence: str, *, quiet: bool) -> Plan:
    """The plan with the starts, domains and maps of evidence that belong to its images."""
    from ffseg.batch.plan.jobs import with_domains, with_evidence, with_starts
    from ffseg.cli.reporting import show_skipped
    from ffseg.io.starts import finds_starts

    show_skipped(plan, quiet=quiet)
    if starts:
        plan = with_starts(plan, starts, partial=finds_starts(params))
    plan = with_domains(plan, params.domain.masks) if params.domain.masks else plan
    return with_evidence(plan, evidence) if evidence else plan


def _views(plan: Plan, camera: Path, poses: Path | None, pairs: Path | None, footprint: float | None) -> CameraSetup:
    from ffseg.batch.views import load_views, with_bag

    names = [job.source.name for job in plan.jobs]
    stamps = {job.source.name: job.source.stamp for job in plan.jobs if job.source.stamp is not None}
    bag = plan.jobs[0].source.path if stamps and poses and not poses.exists() else ""
    motion, known = (os.fspath(path) if path else None for path in (None if bag else poses, pairs))
    views = load_views(os.fspath(camera), motion, known, names, footprint)
    return with_bag(views, bag, str(poses), stamps) if stamps else views


def _ordered(plan: Plan, setup: Setup, shard: str, told: str) -> Plan:
    """The plan with the images before each image, where it is asked for; of a shard only its part.

    Said of the starts file that is to be told of, if any: how many images it does not name and none before them does.
    """
    from ffseg.batch.plan.jobs import with_earlier, with_past
    from ffseg.batch.shards.assign import read_shard, shard_plan
    from ffseg.cli.reporting import show_without_start

    plan = with_earlier(plan, setup.views.chain) if setup.views else plan
    plan = with_past(plan, held=setup.past == "steady") if setup.past else plan
    if told:
        show_without_start(plan, told)
    return shard_plan(plan, read_shard(shard)) if shard else plan


def _preview(plan: Plan, setup: Setup, options: Options, *, as_json: bool) -> int:
    """Show what a run would do; its exit code as far as that is known."""
    from ffseg.batch.preview import preview
    from ffseg.cli.reporting import show_plan

    return 0 if show_plan(preview(plan, setup, options), plan, as_json=as_json) else console.FAILED_IMAGES


def _early_workers(inputs: Sequence[str], jobs: int) -> list[Process]:
    """Workers that load OpenCV while this process loads the rest, reads parameters and plans; two if there may be work."""
    several = jobs > 1 and (len(inputs) != 1 or os.path.isdir(inputs[0]) or is_film(inputs[0]))
    early: list[Process] = []
    with contextlib.suppress(OSError):  # no more descriptors or processes: the run says so itself
        early.append(take_process())
        early += [launch()] if several else []
    return early
