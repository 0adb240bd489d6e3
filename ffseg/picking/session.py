"""A picking session: images, classes, background work, and the requests of the page."""

from __future__ import annotations

import os
import re
import threading
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from ffseg.arrays import Mask
from ffseg.batch.plan.beside import find_domains
from ffseg.batch.plan.jobs import make_plan
from ffseg.batch.plan.reading import place_of
from ffseg.batch.plan.sources import InputImage
from ffseg.batch.record.lock import OutputLock
from ffseg.batch.report.folder import read_folder
from ffseg.batch.values import Mark
from ffseg.batch.workers.freshness import mark_of
from ffseg.batch.workers.pictures import read_source
from ffseg.errors import FfsegError, ImageReadError, ParameterError, UsageError
from ffseg.io.files import make_folder, printable, write_bytes_atomic
from ffseg.io.images import prepare_worker
from ffseg.io.labels import Labels
from ffseg.io.masks import encode_mask, named_masks
from ffseg.io.starts import check_starts
from ffseg.parameter_files import load_params
from ffseg.parameter_text import as_settings
from ffseg.parameters import Parameters, click_radius
from ffseg.picking.learner import Work
from ffseg.picking.open_image import OpenImage, PickedRegion
from ffseg.picking.picks import ImagePicks
from ffseg.picking.project import REGIONS, RUN, STARTS, Project, size_of
from ffseg.pipeline import outlines_of
from ffseg.plugins import check_source
from ffseg.schema.kinds import names_code

MAX_OPEN = 3
"""Images that are held decoded: the one that is picked in, the one before and the one after."""

CLASSES = "classes.txt"
_LABEL = re.compile(r"[\w][\w .-]{0,63}")


class StaleError(Exception):
    """What a page wants to change has been changed elsewhere since."""


class Session:
    """See the module; also a context manager, which holds the lock of the folder.

    Parameters
    ----------
    inputs : sequence of str
        Image files, folders and patterns.
    out : str
        Folder that everything is saved in.
    labels : sequence of str
        Names of classes, each with a folder of its own; none for a single class in `out` itself.
    review : str
        Output folder of a run to be reviewed, or empty.

    Raises
    ------
    UsageError
        If there is no image, two would share a mask, a label is no file name, or another session holds the folder.
    OutputError
        If the folder cannot be written.
    """

    def __init__(
        self, inputs: Sequence[str], out: str, params: Parameters, labels: Sequence[str] = (), review: str = ""
    ) -> None:
        prepare_worker()
        for label in labels:
            if not _LABEL.fullmatch(label):
                raise UsageError(
                    f"--labels: {label[:40]!r} is no name for a folder; use letters, digits, space, - and _"
                )
        if len(set(labels)) < len(labels):
            raise UsageError("--labels: a class is named twice; name each once")
        self.inputs, self.out = [place_of(one) for one in inputs], out
        planned = make_plan(inputs, os.path.join(out, RUN))
        self.sources: list[InputImage] = [job.source for job in planned.jobs if not job.source.problem]
        if not self.sources:
            raise UsageError("no image can be opened; check the folder")
        self._masks = named_masks(params)
        self._domains = find_domains(self.sources, params.domain.masks) if params.domain.masks else {}
        check_starts(params, os.path.join(out, STARTS))
        check_source(params.edges.source, params.edges.model, alike=params.region.islands == "all")
        self._levels, self.labels = params.input.range, tuple(labels) or ("",)
        self.folders = [os.path.join(out, label) if label else out for label in self.labels]
        self._require_apart()
        make_folder(out)
        with ExitStack() as held:
            held.enter_context(OutputLock(out))
            self._begin(params, labels, review, held)
            self._held = held.pop_all()

    def _require_apart(self) -> None:
        """Refuse the images' folder: what is picked is marked as none, which would hide them from other commands."""
        folders = {os.path.realpath(one) for one in self.inputs}
        folders |= {os.path.dirname(os.path.realpath(one.path)) for one in self.sources}
        own = next((one for one in self.folders if os.path.realpath(one) in folders), None)
        if own is not None:
            raise UsageError(f"{printable(own)} holds the images themselves; name a folder beside them with --out")

    def _begin(self, params: Parameters, labels: Sequence[str], review: str, held: ExitStack) -> None:
        """Read what was picked before, and write what follows from it."""
        out = self.out
        if labels:
            write_bytes_atomic(os.path.join(out, CLASSES), "".join(f"{one}\n" for one in labels).encode())
        self.projects: list[Project] = []
        for folder, label in zip(self.folders, self.labels, strict=True):
            project = Project(folder, self.sources, self.inputs, params, review=review, label=label)
            held.callback(project.journal.close)
            self.projects.append(project)
        self._opened: OrderedDict[int, OpenImage] = OrderedDict()
        self._marks: dict[int, Mark] = {}
        self._opening, self._changing = threading.Lock(), threading.RLock()
        self._work = [Work(project, self.forget, self._changing) for project in self.projects]
        for work in self._work:
            for name in work.project.outdated():
                self._mend(work.project, name)
            work.project.write_starts()
            work.learn()

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def close(self) -> None:
        """End what runs in the background and let the folder go."""
        for work in self._work:
            work.stop()
        self._held.close()

    def take(self, labels: Labels) -> tuple[int, list[str]]:
        """Take regions drawn elsewhere as masks of images in which nothing was picked.

        Returns
        -------
        taken : int
            How many were.
        odd : list of str
            Images with a region that holds no pixel of theirs, or all of them.

        Raises
        ------
        UsageError
            If a region does not fit its image.
        """
        labels = labels.named([source.name for source in self.sources])
        found = list(self._drawn(labels))  # all of them can be read before one is taken
        for project, index, mask in found:
            project.take(self.sources[index], mask)
            self._keep_step(project, index, self._found(project, index, project.track(index).now))
        for work in self._work:
            work.learn(again=bool(found))
        return len(found), [*labels.odd]

    def _drawn(self, labels: Labels) -> Iterator[tuple[Project, int, bytes]]:
        """Masks of labels, as PNG, of images in which nothing was picked."""
        for index, source in enumerate(self.sources):
            if source.name not in labels.regions:
                continue
            try:
                shape = self.open_image(index).shape
            except ImageReadError:  # the page says why
                continue
            for project in self.projects:
                track = project.journal.track(source.name)
                mask = None if track.version else labels.mask(source.name, project.label, shape)
                if mask is not None and _has_two_sides(mask):
                    yield project, index, encode_mask(mask)

    def changed(self) -> list[str]:
        """Images whose file is newer than the mask, or of another size than at the last step: another may have been meant."""
        return [one.name for one in self.sources if any(_replaced(one, project) for project in self.projects)]

    def open_image(self, index: int) -> OpenImage:
        """An image, decoded; anew where its file has changed.

        Raises
        ------
        ImageReadError
            If it cannot be read.
        """
        source = self.sources[index]
        with self._opening:
            mark = mark_of(source.path)
            if index not in self._opened or self._marks[index] != mark:
                self._marks[index] = mark
                masks = self._masks.within(self._domains.get(source.name, ""))
                self._opened[index] = OpenImage(read_source(source, levels=self._levels), masks)
                while len(self._opened) > MAX_OPEN:
                    self._opened.popitem(last=False)
            self._opened.move_to_end(index)
            return self._opened[index]

    def picture_address(self, index: int) -> str:
        """Of the image's picture on the page: another one for another file."""
        return f"image/{index}?{'-'.join(map(str, mark_of(self.sources[index].path)))}"

    def forget(self) -> None:
        """Find regions anew: a model is another one."""
        with self._opening:
            for open_image in self._opened.values():
                open_image.forget()

    def about(self) -> dict[str, Any]:
        """What the page is told once."""
        names = [printable(one.name) for one in self.sources]
        return {"labels": list(self.labels), "images": names, "out": printable(self.out)}

    def statuses(self, label: int) -> dict[int, str]:
        """Images that are no longer open."""
        tracks = self.projects[label].journal.tracks
        found = {index: tracks[one.name].now.status for index, one in enumerate(self.sources) if one.name in tracks}
        return {index: status for index, status in found.items() if status != "open"}

    def image(self, label: int, index: int) -> dict[str, Any]:
        """What is picked in an image, and what the page shows; else why it cannot be."""
        track, problem = self.projects[label].track(index), ""
        try:
            height, width = self.open_image(index).shape
        except ImageReadError as error:
            height, width, problem = 1, 1, str(error)
        return {
            "picked": asdict(track.now),
            "version": track.version,
            "undo": len(track.past),
            "redo": len(track.future),
            "problem": problem,
            "picture": "" if problem else self.picture_address(index),
            "width": width,
            "height": height,
            "radius": click_radius((height, width)),
            "probability": self.projects[label].params.region.probability,
            "clearance": self.projects[label].params.contour.clearance,
        }

    def find(self, label: int, index: int, document: object, *, quick: bool) -> dict[str, Any]:
        """The region of what is picked, for the page to draw; nothing is kept. Of what is accepted the mask that was written."""
        project = self.projects[label]
        picked = self._picked(project, index, document, fit=not quick)
        if picked.status == "accepted" and picked == project.track(index).now:
            mask = project.mask(self.sources[index].name)
            if mask is not None and mask.shape == self.open_image(index).shape:
                return PickedRegion(mask, outlines_of(mask), source="mask").document()
        return self._found(project, index, picked, quick=quick).document()

    def _picked(self, project: Project, index: int, document: object, *, fit: bool) -> ImagePicks:
        """What a page says; a stroke more on what is accepted changes no more than it paints."""
        picked, now = ImagePicks.read(document), project.track(index).now
        if fit:
            picked = self._fitted(project, index, picked, now)
        painted = now.status == picked.status == "accepted" and picked.unpainted == now.unpainted
        return replace(picked, base=now.base if painted else "")

    def _fitted(self, project: Project, index: int, picked: ImagePicks, now: ImagePicks) -> ImagePicks:
        """With discs of new clicks that fit in what is narrow, where clicks are all that tells the region."""
        new, params = set(picked.starts) - set(now.starts), project.params
        if not new or picked.boxes or params.edges.model is not None:
            return picked
        image = self.open_image(index)
        return replace(picked, starts=tuple(image.fitted(one, params) if one in new else one for one in picked.starts))

    def _found(self, project: Project, index: int, picked: ImagePicks, *, quick: bool = False) -> PickedRegion:
        open_image = self.open_image(index)
        kept = project.mask(picked.base, REGIONS) if picked.base else None
        if kept is not None and kept.shape == open_image.shape:
            return open_image.find(ImagePicks(strokes=picked.strokes), project.params, kept, quick=quick)
        base = project.base(self.sources[index].name)
        fits = base is not None and base.shape == open_image.shape
        return open_image.find(picked, project.params, base if fits else None, quick=quick)

    def change(
        self, label: int, index: int, version: int, do: str, document: object = None, seen: str = ""
    ) -> dict[str, Any]:
        """Take a step in an image and keep it on the disk before the page hears of it.

        Parameters
        ----------
        seen : str
            Address of the picture that it was taken on.

        Raises
        ------
        StaleError
            If the page has not seen the last step.
        UsageError
            If what is accepted has no region, or what is picked cannot be read.
        """
        if do not in ("pick", "undo", "redo"):
            raise KeyError(do)
        project, name = self.projects[label], self.sources[index].name
        if seen and seen != self.picture_address(index):
            raise UsageError("the image's file was replaced or removed since it was opened; reload the page to see it")
        with self._changing:
            track = project.track(index)
            if track.version != version:
                raise StaleError
            picked = self._picked(project, index, document, fit=True) if do == "pick" else None
            after, found = track.after(do, picked), None
            if after is not None and after.status == "accepted":
                found = self._found(project, index, after)
                if not _has_two_sides(found.mask):
                    raise UsageError("a mask needs pixels inside and outside; pick a region first, or skip the image")
                if picked is not None and not picked.base:
                    picked = replace(picked, base=project.keep_region(found.mask if found.base is None else found.base))
            if project.journal.add(name, do, picked, size_of(self.sources[index].path)):
                self._keep_step(project, index, found)
                if project.track(index).accepted:
                    self._work[label].learn(again=True)
        return self.image(label, index)

    def _mend(self, project: Project, name: str) -> None:
        """Write the mask that a crash has kept from being written; an image that has none any more is open again."""
        index, now = (
            next((at for at, one in enumerate(self.sources) if one.name == name), -1),
            project.journal.track(name).now,
        )
        if index < 0:  # of an image that is not among these
            return
        found: PickedRegion | None = None
        if now.status == "accepted":
            try:
                found = self._found(project, index, now)
            except ImageReadError:  # the page says why
                return
            if not _has_two_sides(found.mask):
                project.journal.add(name, "undo")
                found = None
        self._keep(project, index, found)

    def _keep(self, project: Project, index: int, found: PickedRegion | None) -> None:
        source = self.sources[index]
        own = found is None or os.path.isfile(source.display_path)
        project.keep(source, found, b"" if own else self.open_image(index).picture())

    def _keep_step(self, project: Project, index: int, found: PickedRegion | None) -> None:
        """Bring the files up to a step, which is taken back where what follows from it cannot be written."""
        try:
            self._keep(project, index, found)
        except FfsegError:
            project.journal.take_back()
            with suppress(FfsegError):
                project.write_starts()
            raise

    def following(self, label: int, index: int) -> int:
        """The open image to show after another; -1 where there is no other.

        After one that is open the next in line: those the model is least sure of, then the folder's order. After one
        that is not, the first that is doubted, else the next in the folder.
        """
        statuses, places = self.statuses(label), {one.name: number for number, one in enumerate(self.sources)}
        doubted = [places[name] for name in self._work[label].order if places.get(name, -1) not in (-1, *statuses)]
        line = list(dict.fromkeys([*doubted, *(one for one in places.values() if one not in statuses)]))
        if index in line:
            following = line[(line.index(index) + 1) % len(line)]
            return following if following != index else -1
        if doubted or not line:
            return line[0] if line else -1
        return min(line, key=lambda one: (one - index) % len(self.sources))

    def news(self, label: int, index: int) -> dict[str, Any]:
        """What may have changed since the page asked last."""
        project, work = self.projects[label], self._work[label]
        return {
            "version": project.track(index).version,
            "accepted": project.count("accepted"),
            "skipped": project.count("skipped"),
            "lines": [work.ran, work.line],
            "model": work.generation,
            "command": project.command(),
            "running": work.runs,
            "review": printable(project.review),
        }

    def run(self, label: int) -> None:
        """Do the whole folder in the background."""
        self._work[label].run()


def _has_two_sides(mask: Mask) -> bool:
    return bool(mask.any() and not mask.all())


def _replaced(source: InputImage, project: Project) -> bool:
    before, now = project.journal.track(source.name).size, size_of(source.path)
    if before is not None and now is not None and before != now:
        return True
    with suppress(OSError):  # an address, or an image that is not accepted
        return os.stat(source.path).st_mtime_ns > os.stat(project.mask_path(source.name)).st_mtime_ns
    return False


def inputs_of(folder: str | os.PathLike[str]) -> list[str]:
    """What a run was asked to do, as its ``run.json`` says.

    Raises
    ------
    UsageError
        If the folder is none of a run.
    """
    return list(read_folder(Path(folder)).inputs)


def settings_of(folder: str | os.PathLike[str]) -> list[str]:
    """What a run was made with, as its ``run.json`` says: texts ``KEY=VALUE``; none where there is no such file.

    Raises
    ------
    ParameterError
        If they are no parameters, or import code: the folder may be somebody else's.
    """
    path = Path(folder) / "run.json"
    stored = read_folder(Path(folder)).run.get("parameters") if path.is_file() else None
    if not isinstance(stored, dict):
        return []
    try:
        params = load_params(None, stored)
    except ParameterError as error:
        raise ParameterError(f"{printable(path)}: {error}; give the parameters with --config FILE") from error
    code = [name for name in (params.method, params.edges.source) if names_code(name)]
    if code:
        raise ParameterError(
            f"{printable(path)}: {code[0]} imports code; if you trust it, give the parameters with --config FILE"
        )
    if params.edges.source == "evidence":  # of maps that are not known here
        params = replace(params, edges=replace(params.edges, source="auto"))
    return as_settings(params)
