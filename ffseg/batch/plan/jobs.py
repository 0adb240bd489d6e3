"""The plan of a run: one job for each image, after all checks that can be made before the first one starts."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from itertools import chain

from ffseg.batch.outputs.table import (
    FILM_KINDS,
    MAP_FILES,
    MASKS_AND_CONTOURS,
    OUTPUT_FOLDERS,
    PACKS,
    Products,
    tar_name,
)
from ffseg.batch.plan.beside import find_domains, find_evidence, find_truths
from ffseg.batch.plan.discover import discover, identity
from ffseg.batch.plan.reading import place_of, split_member_path
from ffseg.batch.plan.sources import InputImage, Job, film_of, film_stems
from ffseg.errors import OutputError, UsageError
from ffseg.io.files import SKIP_FILE, is_temporary, make_folder, printable, remove_files, write_bytes_atomic
from ffseg.io.starts import load_starts

MAX_NAME_BYTES = 255
"""The longest file name of the file systems in use."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What a run is going to do."""

    out: str
    jobs: tuple[Job, ...]
    products: Products = MASKS_AND_CONTOURS
    with_truth: bool = False
    inputs: tuple[str, ...] = ()
    """What was asked for, as absolute paths and patterns: how the images are found again."""
    shard: str = ""
    """Name of the shard this is, as ``3-of-8``; empty when it is the whole."""
    whole: int = 0
    """Images of all shards together."""
    names: str = ""
    """Digest of their names, when this is a shard."""
    skipped: tuple[tuple[str, int], ...] = ()
    """Suffixes of the files in folders that are taken for no images, and how many there are of each."""

    def outputs(self, job: Job) -> tuple[str, ...]:
        """Outputs of a job, relative to `out`."""
        return tuple(kind.path(job.stem) for kind in self.products.kinds)

    @property
    def tars(self) -> tuple[str, ...]:
        """Tar files of the outputs, relative to `out`; none where each is a file of its own."""
        folders = dict.fromkeys(kind.folder for kind in self.products.kinds if self.products.pack)
        return tuple(map(tar_name, folders))

    @property
    def films(self) -> tuple[str, ...]:
        """Films of all outputs, relative to `out`."""
        names = film_stems(job.source.name for job in self.jobs).values() if self.products.films else ()
        return tuple(f"{name}_{kind}.{FILM_KINDS[kind]}" for name in names for kind in self.products.films)

    def written(self, job: Job) -> tuple[str, ...]:
        """Files that a job's outputs are written to, relative to `out`."""
        return self.tars or self.outputs(job)


def make_plan(
    inputs: Sequence[str | InputImage],
    out: str,
    *,
    products: Products = MASKS_AND_CONTOURS,
    truth: str = "",
    exclude: Sequence[str] = (),
    keep_suffix: bool = False,
    film: bool = False,
) -> Plan:
    """Find the inputs, pair them with their outputs and truths, and refuse what cannot work.

    Nothing is written.

    Parameters
    ----------
    inputs : sequence of str or InputImage
        As `discover` takes them.
    truth : str
        Folder or tar file of true masks, or empty.
    exclude : sequence of str
        Patterns of relative names, or of folders or files in them, that are left out.
    keep_suffix : bool
        Outputs keep the suffix of their image before their own, so that ``a.jpg`` and ``a.png`` do not collide.
    film : bool
        Take every frame of animations and every page of stacks.

    Raises
    ------
    UsageError
        If an input is missing, two inputs share an output, or an output would replace an input.
    """
    skipped: Counter[str] = Counter()
    sources = without_matches(discover(inputs, film=film, skipped=skipped), exclude)
    truths: dict[str, str] = {}
    if truth:
        truths = find_truths(sources, truth)
        used = {os.path.realpath(path) for path in truths.values()}
        sources = [source for source in sources if os.path.realpath(source.content) not in used]
    stems = [source.name if keep_suffix else os.path.splitext(source.name)[0] for source in sources]
    jobs = tuple(
        Job(index, _checked_name(source, stem, products), stem, truths.get(source.name, ""))
        for index, (source, stem) in enumerate(zip(sources, stems, strict=True))
    )
    places = tuple(place_of(text) for text in inputs if isinstance(text, str))
    plan = Plan(out, jobs, products, with_truth=bool(truth), inputs=places, skipped=tuple(skipped.most_common()))
    _refuse_collisions(plan)
    _refuse_outputs_over_inputs(plan)
    return plan


def with_earlier(plan: Plan, chain: Callable[[str], Iterable[str]]) -> Plan:
    """The plan with the images before each image, whose names the chain gives, the nearest first."""
    paths = {job.source.name: job.source.content for job in plan.jobs}
    jobs = tuple(replace(job, earlier=tuple(paths[name] for name in chain(job.source.name))) for job in plan.jobs)
    return replace(plan, jobs=jobs)


def with_past(plan: Plan, *, held: bool) -> Plan:
    """The plan with each frame's predecessor in its film, or each image's in its folder; `held` starts go on to the next."""
    last: dict[tuple[str, str], Job] = {}
    jobs = []
    for job in plan.jobs:
        film = film_of(job.source.name), os.path.dirname(job.source.path)
        before = last.get(film)
        if before is not None:
            start = before.start.next_frame() if held and before.start and not job.start else job.start
            past = plan.outputs(before)[0]
            job = replace(job, earlier=(before.source.content,), past=past, start=start)  # noqa: PLW2901 - the same
        last[film] = job
        jobs.append(job)
    return replace(plan, jobs=tuple(jobs))


def with_starts(plan: Plan, path: str, *, partial: bool = False) -> Plan:
    """The plan with each image's start out of a file, if it has one there; with `partial` none needs one."""
    starts = load_starts(path, [source.name for source in _tried(plan)], partial=partial)
    return replace(plan, jobs=tuple(replace(job, start=starts.get(job.source.name)) for job in plan.jobs))


def with_evidence(plan: Plan, folder: str) -> Plan:
    """The plan with each image's map of evidence: as `find_evidence`; images that cannot even be tried need none."""
    maps = find_evidence(_tried(plan), folder)
    return replace(plan, jobs=tuple(replace(job, evidence=maps.get(job.source.name, "")) for job in plan.jobs))


def with_domains(plan: Plan, folder: str) -> Plan:
    """The plan with each image's own domain: as `find_domains`; images that cannot even be tried need none."""
    masks = find_domains(_tried(plan), folder)
    return replace(plan, jobs=tuple(replace(job, domain=masks.get(job.source.name, "")) for job in plan.jobs))


def _tried(plan: Plan) -> list[InputImage]:
    return [job.source for job in plan.jobs if not job.source.problem]


def without_matches(sources: Sequence[InputImage], exclude: Sequence[str]) -> list[InputImage]:
    """Sources without those whose name, or a folder or the file in it, matches a pattern."""
    left = [source for source in sources if not any(_matches(source.name, pattern) for pattern in exclude)]
    if sources and not left:
        raise UsageError(f"--exclude leaves no image; the patterns are {', '.join(map(printable, exclude))}")
    return left


def _matches(name: str, pattern: str) -> bool:
    return fnmatchcase(name, pattern) or any(fnmatchcase(part, pattern.rstrip("/")) for part in name.split("/"))


def _checked_name(source: InputImage, stem: str, products: Products) -> InputImage:
    *folders, last = stem.split("/")
    longest = max(len(os.fsencode(part)) for part in (*folders, ""))
    suffix = max(len(kind.suffix) for kind in products.kinds)
    if source.problem:
        return source
    if {"", ".", ".."} & set(folders) or last in ("", ".", ".."):  # its outputs would leave the output folder
        return replace(source, problem="bad-name: the name leads out of its folder; rename the file")
    if max(longest, len(os.fsencode(last)) + suffix) <= MAX_NAME_BYTES:
        return source
    return replace(source, problem="bad-name: its outputs' names would be too long; rename the file")


def _refuse_collisions(plan: Plan) -> None:
    fold = str.casefold if _ignores_case(plan.out) else str
    owners: dict[str, Job] = {}
    sharing: dict[str, list[Job]] = {}
    for job in plan.jobs:
        other = owners.setdefault(fold(job.stem), job)
        if other is not job:
            sharing.setdefault(fold(job.stem), [other]).append(job)
    if sharing:
        raise UsageError("\n".join(_shared(jobs) for jobs in sharing.values()))
    folders = {fold(folder) for job in plan.jobs for folder in _parents(job.stem)}
    for stem, job in owners.items():
        taken = next((stem + suffix for suffix in (".png", ".svg") if stem + suffix in folders), None)
        if taken:
            raise UsageError(
                f"the output {printable(taken)} of {printable(job.source.display_path)} is also the folder "
                "of other outputs; rename the image or the folder"
            )


def _shared(jobs: Sequence[Job]) -> str:
    """Sentence about images that would share an output."""
    *others, last = (printable(job.source.display_path) for job in jobs)
    remedy = "rename all but one, or use several output folders"
    if len({job.source.name for job in jobs}) == len(jobs):
        remedy += "; 'ffseg run' also has --keep-suffix"
    return f"{', '.join(others)} and {last} would share the output name {printable(jobs[0].stem)}; {remedy}"


def _parents(stem: str) -> Iterable[str]:
    while "/" in stem:
        stem = stem.rsplit("/", 1)[0]
        yield stem


def _ignores_case(folder: str) -> bool:
    """Whether the file system of an output folder takes ``A`` and ``a`` for one name."""
    while not os.path.isdir(folder):
        folder = os.path.dirname(os.path.abspath(folder))
    swapped = os.path.abspath(folder).swapcase()
    try:
        return swapped != os.path.abspath(folder) and os.path.samefile(folder, swapped)
    except OSError:
        return False


def _refuse_outputs_over_inputs(plan: Plan) -> None:
    read = {path for job in plan.jobs for path in (job.source.path, job.truth, job.evidence, job.domain)}
    inputs = {identity(file) for file in {split_member_path(path)[0] for path in read - {""}}} - {None}
    for path in _written(plan):
        if identity(path) in inputs:
            raise UsageError(f"the output {printable(path)} would replace an input image; choose another output folder")


def _written(plan: Plan) -> Iterator[str]:
    """Paths of all files that images' outputs are written to."""
    fused = MAP_FILES if plan.products.metric else ()
    jobs = plan.jobs[:1] if plan.tars else plan.jobs
    outputs = (output for job in jobs for output in plan.written(job))
    return (os.path.join(plan.out, output) for output in chain(fused, outputs))


def output_folders(plan: Plan) -> list[str]:
    """Folders of all outputs of a plan that are files; what cannot even be tried has none."""
    if plan.tars:
        return []
    jobs = (job for job in plan.jobs if not job.source.problem)
    folders = {os.path.dirname(output) for job in jobs for output in plan.outputs(job)}
    return [os.path.join(plan.out, folder) for folder in sorted(folders)]


def prepare_output(plan: Plan, state: str) -> None:
    """Make every output folder and prove that a file can be written to the folder of the run's state."""
    packs = [os.path.join(state, PACKS)] if plan.tars else []
    for folder in (state, *packs, *output_folders(plan)):
        make_folder(folder)
    for kind in () if plan.tars else plan.products.kinds:
        if kind.folder not in OUTPUT_FOLDERS:  # of a plug-in: its pictures are no inputs of the next run
            write_bytes_atomic(os.path.join(plan.out, kind.folder, SKIP_FILE), b"")
    probe = os.path.join(state, "probe")
    try:
        write_bytes_atomic(probe, bytes(PROBE_BYTES))
        os.unlink(probe)
    except OSError as error:
        raise OutputError(f"{printable(plan.out)} cannot be written ({os.strerror(error.errno or 0)})") from error


def sweep(plan: Plan, state: str) -> None:
    """Remove the temporaries of a run that was killed; under the lock nobody else can be writing one.

    A shard leaves those of the images alone: another shard may be writing them.
    """
    for folder in (state, *(() if plan.shard else (plan.out, *output_folders(plan)))):
        with os.scandir(folder) as entries:
            left = [entry.path for entry in entries if is_temporary(entry.name)]
        remove_files(left)


PROBE_BYTES = 1 << 16
"""A disk that cannot take this much more cannot take the outputs of one image."""
