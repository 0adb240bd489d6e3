"""All that is picked in a folder: images, classes, what runs in the background, and what the page may ask and change."""

from __future__ import annotations

import json
import os
import re
import threading
from collections import OrderedDict
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ffseg.batch.plan.beside import find_domains
from ffseg.batch.plan.jobs import make_plan
from ffseg.batch.plan.reading import place_of
from ffseg.batch.plan.sources import Source
from ffseg.batch.record.lock import OutputLock
from ffseg.batch.report.folder import read_folder
from ffseg.batch.values import Mark
from ffseg.batch.workers.freshness import mark_of
from ffseg.batch.workers.pictures import read_source
from ffseg.errors import FfsegError, ImageReadError, UsageError
from ffseg.io.files import make_folder, printable, write_bytes_atomic
from ffseg.io.images import single_thread
from ffseg.io.labels import Labels
from ffseg.io.masks import named_masks
from ffseg.io.starts import check_starts
from ffseg.io.tables import counted
from ffseg.parameters import Parameters
from ffseg.picking.learner import LEAST_MASKS, Background, figures_said, last_line
from ffseg.picking.picks import Picked
from ffseg.picking.project import MODEL, RUN, STARTS, Project, size_of
from ffseg.picking.scene import Found, Scene
from ffseg.pipeline import outlines_of

MOST_OPEN = 3
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
        single_thread()
        for label in labels:
            if not _LABEL.fullmatch(label):
                raise UsageError(
                    f"--labels: {label[:40]!r} is no name for a folder; use letters, digits, space, - and _"
                )
        if len(set(labels)) < len(labels):
            raise UsageError("--labels: a class is named twice; name each once")
        self.inputs, self.out = [place_of(one) for one in inputs], out
        planned = make_plan(inputs, os.path.join(out, RUN))
        self.sources: list[Source] = [job.source for job in planned.jobs if not job.source.problem]
        if not self.sources:
            raise UsageError("no image can be opened; check the folder")
        self._masks = named_masks(params)
        self._domains = find_domains(self.sources, params.domain.masks) if params.domain.masks else {}
        check_starts(params, os.path.join(out, STARTS))
        make_folder(out)
        self._levels, self.labels = params.input.range, tuple(labels) or ("",)
        with ExitStack() as held:
            held.enter_context(OutputLock(out))
            self._begin(params, labels, review, held)
            self._held = held.pop_all()

    def _begin(self, params: Parameters, labels: Sequence[str], review: str, held: ExitStack) -> None:
        """Read what was picked before, and write what follows from it."""
        out = self.out
        if labels:
            write_bytes_atomic(os.path.join(out, CLASSES), "".join(f"{one}\n" for one in labels).encode())
        folders = [os.path.join(out, label) if label else out for label in self.labels]
        self.projects: list[Project] = []
        for folder, label in zip(folders, self.labels, strict=True):
            project = Project(folder, self.sources, self.inputs, params, review=review, label=label)
            held.callback(project.journal.close)
            self.projects.append(project)
        self._scenes: OrderedDict[int, Scene] = OrderedDict()
        self._marks: dict[int, Mark] = {}
        self._opening, self._changing = threading.Lock(), threading.RLock()
        self._work = [_Work(project, self) for project in self.projects]
        for work in self._work:
            for name in work.project.outdated():
                self._keep(work.project, name)
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
        taken, labels = 0, labels.named([source.name for source in self.sources])
        for index, source in enumerate(self.sources):
            if source.name not in labels.regions:
                continue
            try:
                shape = self.scene(index).shape
            except ImageReadError:  # the page says why
                continue
            for project in self.projects:
                track = project.journal.track(source.name)
                mask = None if track.version else labels.mask(source.name, project.label, shape)
                if mask is not None and mask.any() and not mask.all():
                    project.take(source, mask)
                    self._keep(project, source.name)
                    taken += 1
        for work in self._work:
            work.learn(again=taken > 0)
        return taken, [*labels.odd]

    def changed(self) -> list[str]:
        """Images whose file is newer than the mask, or of another size than at the last step: another may have been meant."""
        return [one.name for one in self.sources if any(_replaced(one, project) for project in self.projects)]

    def scene(self, index: int) -> Scene:
        """An image, decoded.

        Raises
        ------
        ImageReadError
            If it cannot be read.
        """
        source = self.sources[index]
        with self._opening:
            if index not in self._scenes:
                self._marks[index] = mark_of(source.path)
                masks = self._masks.within(self._domains.get(source.name, ""))
                self._scenes[index] = Scene(read_source(source, levels=self._levels), masks)
                while len(self._scenes) > MOST_OPEN:
                    self._scenes.popitem(last=False)
            self._scenes.move_to_end(index)
            return self._scenes[index]

    def forget(self) -> None:
        """Find regions anew: a model is another one."""
        with self._opening:
            for scene in self._scenes.values():
                scene.forget()

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
        """What is picked in an image, read anew where its file changed, and what the page shows; else why it cannot be."""
        if self._marks.get(index) != mark_of(self.sources[index].path):
            with self._opening:
                self._scenes.pop(index, None)
        track, problem = self.projects[label].track(index), ""
        try:
            height, width = self.scene(index).shape
        except ImageReadError as error:
            height, width, problem = 1, 1, str(error)
        return {
            "picked": asdict(track.now),
            "version": track.version,
            "undo": len(track.past),
            "redo": len(track.future),
            "problem": problem,
            "width": width,
            "height": height,
            "radius": start_radius((height, width)),
            "probability": self.projects[label].params.region.probability,
            "clearance": self.projects[label].params.contour.clearance,
        }

    def find(self, label: int, index: int, document: object, *, quick: bool) -> dict[str, Any]:
        """The region of what is picked, for the page to draw; nothing is kept. Of what is accepted the mask that was written."""
        project, picked = self.projects[label], Picked.read(document)
        if picked.status == "accepted" and picked == project.track(index).now:
            mask = project.mask(self.sources[index].name)
            if mask is not None and mask.shape == self.scene(index).shape:
                return Found(mask, outlines_of(mask), source="mask").document()
        return self._found(project, index, picked, quick=quick).document()

    def _found(self, project: Project, index: int, picked: Picked, *, quick: bool = False) -> Found:
        scene = self.scene(index)
        base = project.base(self.sources[index].name)
        if base is not None and base.shape != scene.shape:
            base = None
        return scene.find(picked, project.params, base, quick=quick)

    def change(self, label: int, index: int, version: int, do: str, document: object = None) -> dict[str, Any]:
        """Take a step in an image and keep it on the disk before the page hears of it.

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
        picked = Picked.read(document) if do == "pick" else None
        if self._marks.get(index) not in (None, mark_of(self.sources[index].path)):
            raise UsageError("the image's file was replaced or removed since it was opened; reload the page to see it")
        with self._changing:
            track = project.track(index)
            if track.version != version:
                raise StaleError
            after = track.after(do, picked)
            if after is not None and after.status == "accepted":
                mask = self._found(project, index, after).mask
                if not mask.any() or mask.all():
                    raise UsageError("a mask needs pixels inside and outside; pick a region first, or skip the image")
            if project.journal.add(name, do, picked, size_of(self.sources[index].path)):
                changed = self._keep(project, name)
                if changed:
                    self._work[label].learn(again=True)
        return self.image(label, index)

    def _keep(self, project: Project, name: str) -> bool:
        """Bring the files up to the journal; whether a mask has changed."""
        track = project.journal.track(name)
        index = next((number for number, one in enumerate(self.sources) if one.name == name), -1)
        if index < 0:
            return False
        accepted = track.now.status == "accepted"
        try:
            project.keep(self.sources[index], self._found(project, index, track.now) if accepted else None)
        except FfsegError:
            with suppress(OSError):
                project.drop(name)  # made anew when the folder is opened next
            raise
        return track.accepted

    def following(self, label: int, index: int) -> int:
        """The open image to show after another; -1 where there is none.

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


def _replaced(source: Source, project: Project) -> bool:
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


def start_radius(shape: tuple[int, int]) -> float:
    """Pixels: the radius of a click's circle, a hundredth of the longer side."""
    return max(2.0, round(max(shape) / 100, 1))


class _Work:
    """What runs behind one class: learning after each mask, and the run of the folder.

    A model is used as soon as it is grown, and measured on images left out afterwards; one that is found worse than
    none is taken away again.
    """

    def __init__(self, project: Project, session: Session) -> None:
        self.project = project
        self.line, self.ran, self.order, self.generation = "", "", list[str](), 0
        self._session, self._spared, self._measuring = session, False, False
        self._learning, self._running = Background(self._learned), Background(self._ran)

    @property
    def runs(self) -> bool:
        """Whether the folder is being done."""
        return self._running.running

    def learn(self, *, again: bool = False) -> None:
        """Learn from the masks there are; a newer mask ends what is at work, but of two in a row the second is spared."""
        count = self.project.count("accepted")
        if count < LEAST_MASKS:
            self.line = f"{LEAST_MASKS - count} more accepted and a model is learned from them"
            self._learning.stop()
            if self.project.model:
                self._use(learned=False)
            return
        if self._learning.running and self._spared:
            return
        if not again and self.project.model:
            self.line = f"{count} masks; the model that was learned from them is used"
            return
        self._spared = self._learning.running and not self._measuring
        self.line = f"learning from {count} masks"
        self._count = count
        self._start(measuring=False)

    def _start(self, *, measuring: bool) -> None:
        self._measuring = measuring
        arguments = self.project.learning(self.project.path("learning.ffmodel"))
        self._learning.start([*arguments, *([] if measuring else ["--quick"])])

    def _learned(self, code: int, out: str, err: str) -> None:
        self._spared = False
        if code:
            self.line = f"nothing was learned: {last_line(err)}"
            return
        self.line, self.order, of_use = figures_said(out)
        self._use(learned=of_use)
        if not of_use:
            self.line += "; it is not used"
        if self.project.count("accepted") != self._count:
            self.learn(again=True)
        elif not self._measuring:
            self._start(measuring=True)

    def _use(self, *, learned: bool) -> None:
        """Use what was learned from now on, or no model."""
        paths = self.project.path("learning.ffmodel"), self.project.path(MODEL)
        if learned:
            os.replace(*paths)
        for path in () if learned else paths:
            with suppress(FileNotFoundError):
                os.unlink(path)
        self._session.forget()
        self.generation += 1
        self.project.write_starts()

    def run(self) -> None:
        """Do the folder, anew where it was done before."""
        if self.runs:
            return
        self.project.write_starts()
        self.ran = f"running {counted(len(self.project.sources), 'image')}"
        self._running.start([*self.project.arguments(), "--json", "--quiet"])

    def _ran(self, code: int, out: str, err: str) -> None:
        if code not in (0, 3):
            self.ran = f"the run has failed: {last_line(err)}"
            return
        counts = json.loads(out)["counts"]
        failed = f", {counts['failed']} failed" if counts["failed"] else ""
        self.ran = f"the folder is done: {counted(counts['done'], 'image')}{failed}"
        self.project.review = self.project.path(RUN)
        self._session.forget()
        self.generation += 1

    def stop(self) -> None:
        """End what is at work."""
        self._learning.stop()
        self._running.stop()
