"""One image to its outputs as bytes: a pure function of the file, the parameters and the version."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ffseg import __version__
from ffseg.batch.workers.encoding import Film, Made
from ffseg.batch.workers.messages import Reply, Setup, Task
from ffseg.errors import CalibrationError, FfsegError, ImageReadError, SegmentationError
from ffseg.formats.files import printable, read_bytes
from ffseg.formats.images import OPENCV_VERSION, Limits, decode_image, frames_note, single_thread
from ffseg.formats.masks import load_mask
from ffseg.formats.overlays import Polyline
from ffseg.parameters import Parameters
from ffseg.segmenters.base import Segmentation

if TYPE_CHECKING:
    from ffseg.batch.workers.frames import FrameBench

_FLATNESS = 0.1
"""Tolerance of the lines drawn in overlays, px: a tenth of the line's width."""


def digest(data: bytes) -> str:
    """Digest that stands for content in the journal."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()


class Workbench:
    """What a worker has ready between images; none of it depends on the images it has seen.

    Raises
    ------
    ParameterError
        If a mask file that the parameters name cannot be read.
    """

    def __init__(self, setup: Setup) -> None:
        single_thread()
        module, name = setup.segmenter.split(":")
        self._segment = getattr(import_module(module), name)
        self._setup = setup
        self._limits = Limits(setup.max_bytes, setup.max_pixels)
        self._domain = load_mask("domain.mask", setup.params.domain.mask, self._limits)
        self._start_mask = load_mask("init.mask", setup.params.init.mask, self._limits)
        self._background = load_mask("init.background_mask", setup.params.init.background_mask, self._limits)
        self._frames: FrameBench | None = None
        if setup.views is not None:
            from ffseg.batch.workers.frames import FrameBench, Masks  # loads what only cameras need

            self._frames = FrameBench(
                setup.views, setup.params, Masks(self._domain, self._start_mask, self._background)
            )

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
        try:
            return self._do(task)
        except ImageReadError as error:
            return _failed(task, error.reason, str(error))
        except SegmentationError as error:
            return _failed(task, "segmentation", str(error))
        except CalibrationError as error:
            return _failed(task, "calibration", str(error))
        except FfsegError as error:
            return _failed(task, "parameters", str(error))
        except MemoryError:
            return _failed(task, "out-of-memory", "more memory than a worker may use; raise --memory or scale it down")
        except Exception as error:  # noqa: BLE001 - a defect costs one image, and is written down
            import traceback

            return _failed(task, "internal", f"{type(error).__name__}: {error}", traceback.format_exc())

    def _do(self, task: Task) -> Reply:
        begin = perf_counter()
        data = read_bytes(task.path, self._setup.max_bytes)
        before = self._before(task)
        content = self._content(data, task) + self._pair_content(before, task)
        if task.known is not None and _still_right(task, content):
            return Reply(task.index, "same")
        image = decode_image(data, self._limits)
        decoded = perf_counter()
        params = self._params(task)
        found = self._found(image, before, task, params)
        segmented = perf_counter()
        outputs = tuple(self._outputs(image, found, task))
        result = found.result
        row = _row(image, result, self._setup.params.method) | found.row | _start_cells(params, task)
        row["note"] = "; ".join(filter(None, (frames_note(data, self._limits), *result.messages, row.get("note"))))
        if task.truth:
            row["iou"] = self._iou(result, task.truth)
        end = perf_counter()
        row |= {"decode_ms": (decoded - begin) * 1e3, "write_ms": (end - segmented) * 1e3}
        row["total_ms"] = (end - begin) * 1e3
        return Reply(task.index, "ok", row, content, outputs, found.extra)

    def _found(self, image: NDArray[np.uint8], before: list[bytes], task: Task, params: Parameters) -> _Found:
        film = Film() if self._setup.wanted.animation else None
        overlay = self._setup.wanted.overlay
        if self._frames is None:
            segment = self._segment if film is None else partial(self._segment, callback=film)
            result = segment(
                image, params, domain=self._domain, start_mask=self._start_mask, background=self._background
            )
            lines = [
                Polyline(contour.flatten(_FLATNESS), "outer" if contour.signed_area > 0 else "obstacle")
                for contour in (result.contours if overlay else ())
            ]
            return _Found(result, lines, film)
        from ffseg.batch.workers.frames import merged_segmentation, obstacle_rows, overlay_lines, pair_state

        frames = replace(self._frames, params=params)
        frame = frames.frame_of(image, before, task.name, self._limits, film)
        lines = overlay_lines(frame, _FLATNESS) if overlay else []
        row = {"obstacles_ms": frame.obstacles_ms, "note": frame.note, "pair": pair_state(frame)}
        return _Found(merged_segmentation(frame), lines, film, row, obstacle_rows(frame))

    def _before(self, task: Task) -> list[bytes]:
        """Contents of the images before, the nearest first; empty, which no decoder takes, when one cannot be read."""
        return [self._readable(path) for path in task.earlier]

    def _readable(self, path: str) -> bytes:
        try:
            return read_bytes(path, self._setup.max_bytes)
        except ImageReadError:
            return b""

    def _pair_content(self, before: list[bytes], task: Task) -> str:
        if self._setup.views is None:
            return ""
        contents = digest("".join(map(digest, before)).encode("ascii"))
        return contents + digest(self._setup.views.pair_text(task.name).encode("utf-8"))

    def _content(self, data: bytes, task: Task) -> str:
        truth = self._truth_content(task.truth) if task.truth else ""
        start = task.start.text().encode("ascii") if task.start is not None else b""
        return digest(data) + truth + (f" start {digest(start)}" if start else "")

    def _truth_content(self, path: str) -> str:
        try:
            truth = read_bytes(path, self._setup.max_bytes)
        except ImageReadError as error:
            text = f"the true mask {printable(path)} cannot be used: {error.reason}: {error}"
            raise ImageReadError("truth", text) from error
        label = self._setup.truth_label
        return digest(truth) + ("" if label is None else f" label {label}")

    def _params(self, task: Task) -> Parameters:
        """Parameters of one image."""
        return self._setup.params if task.start is None else task.start.placed(self._setup.params)

    def _outputs(self, image: NDArray[np.uint8], found: _Found, task: Task) -> Iterator[tuple[str, bytes, str]]:
        snapshots = found.film.snapshots if found.film is not None else ()
        made = Made(image, found.result, found.lines, task.name, task.path, snapshots)
        for path, kind in zip(task.outputs, self._setup.wanted.kinds, strict=True):
            data = made.encoded(kind, os.path.join(task.out, path))
            yield path, data, digest(data)

    def _iou(self, result: Segmentation, path: str) -> float:
        from ffseg.batch.workers.truth import read_truth
        from ffseg.metrics import iou

        height, width = result.mask.shape
        return iou(result.mask, read_truth(path, (height, width), self._setup.truth_label, self._limits))


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """A result, its lines for the overlay, and what a camera adds to its rows."""

    result: Segmentation
    lines: list[Polyline]
    film: Film | None
    row: dict[str, Any] = field(default_factory=dict)
    extra: list[dict[str, Any]] = field(default_factory=list)


def _failed(task: Task, reason: str, message: str, trace: str = "") -> Reply:
    return Reply(task.index, "failed", reason=reason, message=message, traceback=trace)


def _still_right(task: Task, content: str) -> bool:
    """Whether the image is what it was, and each of its outputs is there with the content it was given."""
    known_content, known_outputs = task.known or ("", {})
    if known_content != content or set(known_outputs) != set(task.outputs):
        return False
    try:
        return all(digest(_whole(os.path.join(task.out, path))) == known_outputs[path] for path in task.outputs)
    except OSError:
        return False


def _whole(path: str) -> bytes:
    return Path(path).read_bytes()


def _start_cells(params: Parameters, task: Task) -> dict[str, Any]:
    """The image's own start circle, as it was asked for."""
    if task.start is None:
        return {}
    return {"start_x": task.start.x, "start_y": task.start.y, "start_radius": params.init.radius}


def _row(image: NDArray[np.uint8], result: Segmentation, method: str) -> dict[str, Any]:
    stats = result.stats
    return {
        "width": image.shape[1],
        "height": image.shape[0],
        "method": method,
        "initial_points": stats.initial_points,
        "final_points": stats.final_points,
        "patches": stats.patches,
        "iterations": stats.iterations,
        "splits": stats.splits,
        "flips": stats.flips,
        "components": sum(contour.signed_area > 0 for contour in result.contours),
        "holes": result.num_holes,
        "area_px": int(np.count_nonzero(result.mask)),
        "edges_ms": result.timings.edges_ms,
        "evolve_ms": result.timings.evolve_ms,
        "stop_reason": stats.stop_reason,
    }
