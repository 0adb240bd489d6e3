"""From one image to its outputs as bytes: a pure function of the file, the parameters and the version."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from ffseg import __version__
from ffseg.arrays import Image, Mask
from ffseg.batch.outputs.encoding import Context, SnapshotRecorder, encoded_output
from ffseg.batch.outputs.table import Output
from ffseg.batch.tar.members import digest, output_bytes
from ffseg.batch.workers.freshness import JobFiles, kept_outputs, read_job
from ffseg.batch.workers.messages import Done, Encoded, Failed, Reply, Setup, Task
from ffseg.errors import FfsegError, ImageReadError, is_out_of_memory
from ffseg.image.selection import count_regions
from ffseg.io.images import OPENCV_VERSION, Limits, prepare_worker, read_picture
from ffseg.io.masks import decode_mask, named_masks
from ffseg.io.overlays import FLATNESS, polylines
from ffseg.parameters import Parameters
from ffseg.plugins import described, load
from ffseg.result import Segmentation
from ffseg.scene import Scene

if TYPE_CHECKING:
    from ffseg.batch.plan.sources import Job
    from ffseg.batch.values import Record
    from ffseg.batch.workers.past import PastFrame


class Workbench:
    """What a worker has ready between images; none of it depends on the images it has seen."""

    def __init__(self, setup: Setup) -> None:
        prepare_worker()
        self._segment = load(setup.segmenter)
        self._setup = setup
        self._limits = Limits(setup.max_bytes, setup.max_pixels)
        self._masks = named_masks(setup.params, self._limits)
        self._past: PastFrame | None = None
        if setup.past:
            from ffseg.batch.workers.past import PastFrame

            self._past = PastFrame(setup.past == "steady", self._limits)
        if setup.views is not None:
            import ffseg.batch.workers.frames  # noqa: F401 - what only cameras need, and no image waits for

    def versions(self) -> dict[str, str]:
        """Versions that a result can depend on."""
        return {
            "ffseg": __version__,
            "python": sys.version.split()[0],
            "numpy": np.__version__,
            "opencv": OPENCV_VERSION,
            "platform": sys.platform,
        }

    def reply(self, task: Task) -> Reply:
        """Do a task; whatever goes wrong with its image is in the reply."""
        reply = self._reply(task)
        if self._past is not None:
            self._past.remember(task, reply)
        return reply

    def _reply(self, task: Task) -> Reply:
        try:
            return self._do(task)
        except FfsegError as error:
            return Failed(task.job.index, error.reason, str(error))
        except Exception as error:  # noqa: BLE001 - a defect costs one image, and is written down
            if is_out_of_memory(error):
                text = "more memory than a worker may use; raise --memory or scale it down"
                return Failed(task.job.index, "out-of-memory", text)
            import traceback

            return Failed(task.job.index, "internal", described(error), traceback.format_exc())

    def _do(self, task: Task) -> Reply:
        begin, job = perf_counter(), task.job
        read = read_job(job, self._setup)
        read = self._past.known(task, read) if self._past is not None else read
        still_there = kept_outputs(task.recorded, read, task.out)
        kept = still_there or ()
        kinds = zip(task.outputs, self._setup.products.kinds, strict=True)
        missing = [(path, kind) for path, kind in kinds if path not in kept]
        if task.recorded is not None and still_there is not None and not missing:
            return self._unchanged(task, task.recorded, read, kept)
        image, note = read_picture(read.data, self._limits, self._setup.params.input.range)
        decoded = perf_counter()
        if self._past is not None:
            self._past.look(image)
        params = self._params(job, image.shape)
        found = self._found(image, read.before, job, params)
        segmented = perf_counter()
        outputs = tuple(_encoded(found, task.out, missing))
        result = found.result
        row = _row(image, result, self._setup.params.method) | found.row | _start_cells(params, job, image.shape)
        note = "; ".join(filter(None, (note, *result.messages)))
        row["note"] = "; ".join(filter(None, (note, row.get("note"))))
        overlap, problem = self._iou(result.mask, job, read)
        row |= {"iou": overlap} if job.truth else {}
        end = perf_counter()
        row |= {"decode_ms": (decoded - begin) * 1e3, "write_ms": (end - segmented) * 1e3}
        row["total_ms"] = (end - begin) * 1e3
        return Done(job.index, row, read.digests, outputs, kept, found.extra, problem, note=note)

    def _unchanged(self, task: Task, recorded: Record, read: JobFiles, kept: tuple[str, ...]) -> Done:
        """The reply for an image that need not be segmented; the mask on the disk is enough to measure its IoU."""
        row: dict[str, Any] = {}
        problem = recorded.row["error"] if task.job.truth else ""
        if task.job.truth and read.digests.truth != recorded.truth:
            data = output_bytes(task.out, task.outputs[0], recorded.members.get(task.outputs[0]))
            row["iou"], problem = self._iou(decode_mask(data, self._limits), task.job, read)
        return Done(task.job.index, row, read.digests, (), kept, problem=problem, unchanged=True)

    def _found(self, image: Image, before: list[bytes], job: Job, params: Parameters) -> _JobResult:
        products, views, source = self._setup.products, self._setup.views, job.source
        film = SnapshotRecorder() if products.animation else None
        scene = Scene(image, params, callback=film, **self._masks.within(job.domain, self._limits).bounds)
        context = Context(image, source.name, source.display_path, label=self._setup.params.region.label)
        context = context if film is None else replace(context, snapshots=film.snapshots)
        if views is None:
            if job.evidence:
                from ffseg.batch.workers.pictures import read_evidence

                scene = replace(scene, evidence=read_evidence(job.evidence, self._limits))
            absent = self._past and self._past.absent(job.start)
            result = absent or self._segment(scene)
            result, cells = self._past.result(result) if self._past is not None else (result, {})
            return _JobResult(
                result, replace(context, lines=polylines(result.contours) if products.overlay else ()), cells
            )
        from ffseg.batch.workers.frames import (
            EarlierImages,
            camera_state,
            evidence_lines,
            merged_segmentation,
            obstacle_rows,
            overlay_lines,
            pair_state,
        )

        frame = EarlierImages(views, source.name, before, self._limits).frame(scene, mapped=products.metric)
        lines = overlay_lines(frame, FLATNESS) if products.overlay else []
        if products.overlay and params.obstacles.draw:
            lines += evidence_lines(frame)
        row = {"obstacles_ms": frame.obstacles_ms, "note": frame.note, "pair": pair_state(frame)}
        context = replace(context, lines=lines)
        if products.metric:
            context = replace(context, ground=frame.ground(), camera=camera_state(frame))
        return _JobResult(merged_segmentation(frame), context, row, obstacle_rows(frame))

    def _params(self, job: Job, shape: tuple[int, ...]) -> Parameters:
        params = self._setup.params if job.start is None else job.start.placed(self._setup.params, shape)
        return params if self._past is None else self._past.start(params, shape, job.start)

    def _iou(self, mask: Mask, job: Job, read: JobFiles) -> tuple[float | None, str]:
        """Overlap with the true mask, if there is one, and what is wrong with it."""
        if not job.truth or read.truth_problem:
            return None, read.truth_problem
        from ffseg.batch.workers.pictures import read_truth
        from ffseg.metrics import iou

        height, width = mask.shape
        try:
            return iou(mask, read_truth(job.truth, (height, width), self._setup.truth_label, self._limits)), ""
        except ImageReadError as error:
            return None, f"{error.reason}: {error}"


@dataclass(frozen=True, slots=True, eq=False)
class _JobResult:
    """A result, what its outputs are made from beside it, and what a camera or the past adds to its rows."""

    result: Segmentation
    context: Context
    row: dict[str, Any] = field(default_factory=dict)
    extra: list[dict[str, Any]] = field(default_factory=list)


def _encoded(found: _JobResult, out: str, outputs: Sequence[tuple[str, Output]]) -> Iterator[Encoded]:
    for path, kind in outputs:
        data = encoded_output(kind, found.result, replace(found.context, target=os.path.join(out, path)))
        yield Encoded(path, data, digest(data))


def _start_cells(params: Parameters, job: Job, shape: tuple[int, ...]) -> dict[str, Any]:
    """The image's own start circle, as it was asked for."""
    if job.start is None or job.start.held:
        return {}
    radius = None if job.start.x is None else params.init.radius_in(shape)
    return {"start_x": job.start.x, "start_y": job.start.y, "start_radius": radius}


_COUNTS = ("initial_points", "final_points", "patches", "iterations", "splits", "flips")


def _row(image: Image, result: Segmentation, method: str) -> dict[str, Any]:
    stats, (regions, holes) = result.stats, count_regions(result.mask)
    return {
        "width": image.shape[1],
        "height": image.shape[0],
        "method": method,
        **{name: getattr(stats, name) for name in _COUNTS},
        "components": regions,
        "holes": holes,
        "area_px": int(np.count_nonzero(result.mask)),
        "edges_ms": result.timings.edges_ms,
        "evolve_ms": result.timings.evolve_ms,
        "stop_reason": stats.stop_reason,
        "source": result.source,
        "score": result.score,
        "doubts": " ".join(result.doubts),
        "canny_low": result.thresholds[0],
        "canny_high": result.thresholds[1],
    }
