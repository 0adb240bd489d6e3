"""The previous frame of a film that is processed in order: its image and its region."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ffseg.arrays import Image, Mask
from ffseg.batch.tar.members import digest
from ffseg.batch.workers.freshness import JobFiles
from ffseg.batch.workers.messages import Done, Failed, Reply, Task
from ffseg.errors import ImageReadError
from ffseg.image.flow import carried_region, kept_colours, origins, start_in, steadied_region
from ffseg.image.parts import connected_parts
from ffseg.io.files import read_bytes
from ffseg.io.images import Limits, decode_image
from ffseg.io.masks import decode_mask
from ffseg.io.starts import Start
from ffseg.parameters import Box, Circle, Parameters
from ffseg.pipeline import outlines_of
from ffseg.result import Segmentation, Timings
from ffseg.scene import Stats
from ffseg.starts.pockets import START_RADIUS_FRACTION, discs
from ffseg.starts.rivals import add_disc

BOX_ROOM = 0.05
"""By how much a box lies further out than the region that was carried, in parts of the mean of its sides: 18 films of drawings
that pan and zoom, 12 frames each, have an IoU of .73 with it, .71 with 0.1 and .61 with 0.15."""

ABSENT = "what was followed is not seen here; rows of this frame in the starts file say where it is"


@dataclass(frozen=True)
class _Frame:
    """A frame as the next one needs it: the path of its mask, and image and mask as they are encoded, None on the disk."""

    path: str = ""
    image: bytes = b""
    mask: bytes | None = None
    limits: Limits = field(default_factory=Limits)

    @cached_property
    def region(self) -> Mask | None:
        """What its mask shows; None where that cannot be read."""
        try:
            return decode_mask(self.mask, self.limits) if self.mask else None
        except ImageReadError:
            return None


@dataclass(slots=True, eq=False)
class PastFrame:
    """What a worker remembers of the frame it has done last; else its mask is read from the output folder."""

    steady: bool
    """Whether the past changes what is found, or only the flicker is measured."""
    limits: Limits
    _last: _Frame = _Frame()
    """The frame that was done last."""
    _before: _Frame = _Frame()
    """The frame before the one that is done now: the last that shows something, with ``steady``."""
    _carried: tuple[Mask, Mask] | None = None
    """The region of that frame as it was carried to the one that is done now, and the part of it that is seen there."""

    def known(self, task: Task, read: JobFiles) -> JobFiles:
        """What went into a frame, with the frame before and its mask."""
        self._step(task, read)
        image, mask = self._before.image, self._before.mask or b""
        seen = "".join(map(digest, (image, mask) if read.before else (mask,)))
        content = f"{read.digests.content} past {digest(seen.encode('ascii'))}"
        return replace(read, digests=replace(read.digests, content=content))

    def look(self, image: Image) -> None:
        """Carry the region of the frame before to this one; there is none where one of them could not be read."""
        before, region = self._before.image, self._before.region
        self.carry((decode_image(before, self.limits), region) if before and region is not None else None, image)

    def carry(self, last: tuple[Image, Mask] | None, image: Image) -> None:
        """Carry the region of the frame before, given with its image, to this one."""
        self._carried = None
        if last is not None and last[0].shape == image.shape:
            places = origins(last[0], image)
            region = carried_region(last[1], places)
            self._carried = region, region & kept_colours(last[0], image, places) if self.steady else region

    def absent(self, said: Start | None) -> Segmentation | None:
        """The empty result where a starts file said of an earlier frame what to follow, and that is not seen here."""
        picked = said is not None and said.held and not said.found and (said.circles or said.boxes)
        if not (picked and self.steady) or self._carried is None:
            return None
        region, seen = self._carried
        if 2 * np.count_nonzero(seen) > np.count_nonzero(region) or _discs_in(seen):
            return None
        nothing, none = np.zeros_like(region), Timings(0.0, 0.0, 0.0)
        return Segmentation(nothing, (), Stats(stop_reason="vanished"), none, (ABSENT,), doubts=("empty",))

    def start(self, params: Parameters, shape: tuple[int, ...], said: Start | None) -> Parameters:
        """The parameters with the start moved into the carried region or, if there are several, as many in its parts.

        Boxes that a starts file said of an earlier frame become those round its parts; what it says of this one stays. A model of
        many things finds them anew, or none.
        """
        init = params.init
        if self._carried is None or not self.steady or (said and not said.held):
            return params
        from ffseg.evidence.source import finds_all  # loads forests

        region, seen = self._carried
        if said and init.boxes:
            return replace(params, init=replace(init, boxes=_boxes_round(region) or init.boxes))
        if init.boxes or init.mask or (said is None and finds_all(params)):
            return params
        if len(init.circles) > 1:
            circles = _starts_in(seen, len(init.circles)) or init.circles
        else:
            x, y = init.center if init.center != "auto" else ((shape[1] - 1) / 2, (shape[0] - 1) / 2)
            one, *_ = init.circles_in(shape) or ((x, y, init.radius_in(shape)),)
            circles = (start_in(seen, one),)
        return replace(params, init=replace(init, circles=circles))

    def result(self, found: Segmentation) -> tuple[Segmentation, dict[str, float | int]]:
        """The result, steadied where that is asked for, and the cells of its row."""
        if self._carried is None:
            return found, {}
        region, _ = self._carried
        kept, cells = found, {}
        if self.steady:
            mask = steadied_region(found.mask, region)
            moved = int(np.count_nonzero(mask != found.mask))
            kept = replace(found, mask=mask, contours=outlines_of(mask)) if moved else found
            cells = {"steady_px": moved}
        either = int(np.count_nonzero(kept.mask | region))
        both = int(np.count_nonzero(kept.mask & region))
        return kept, {"flicker": 1 - both / either if either else 0.0, **cells}

    def remember(self, task: Task, reply: Reply) -> None:
        """Keep the mask of a frame that is done; that of one that need not be done is on the disk."""
        if isinstance(reply, Failed):
            self._step(task, None)
            self._last = replace(self._last, mask=b"")
        elif isinstance(reply, Done):
            mask = next((one.data for one in reply.outputs if one.path == task.outputs[0]), None)
            self._last = replace(self._last, mask=mask)

    def _step(self, task: Task, read: JobFiles | None) -> None:
        """Go on to a frame, once: find out what stands before it."""
        last, past = self._last, task.job.past
        if last.path == task.outputs[0]:
            return
        if past != last.path:  # its first frame, or this process has just begun
            image = next(iter(read.before), b"") if read else b""
            last, self._before = _Frame(past, image, limits=self.limits), _Frame()
        if past and last.mask is None:
            last = replace(last, mask=self._mask(f"{task.out}/{past}"))
        if not self.steady or (last.region is not None and last.region.any()):
            self._before = last
        self._last = _Frame(task.outputs[0], read.data if read else b"", limits=self.limits)

    def _mask(self, path: str) -> bytes:
        try:
            return read_bytes(path, self.limits.max_bytes)
        except ImageReadError:
            return b""


def _boxes_round(region: Mask) -> tuple[Box, ...]:
    """A box round each part of a region, with room for what has moved; none round specks."""
    parts, found = connected_parts(region), []
    for x, y, _ in _discs_in(region):
        rows, columns = np.nonzero(parts.labels == parts.labels[int(y), int(x)])
        left, top, right, bottom = (float(at) for at in (columns.min(), rows.min(), columns.max(), rows.max()))
        room = max(BOX_ROOM * (right - left + bottom - top + 2) / 2, 2.0)
        found.append((left - room, top - room, right + room, bottom + room))
    return tuple(found)


def _starts_in(region: Mask, count: int) -> tuple[Circle, ...]:
    """So many starts at the deepest places of a region, and at least one in each part: what has met may part again."""
    found, left = list[Circle](), region.copy()
    while left.any() and (not found or len(found) < count):
        more = _discs_in(region, left)
        if not more:
            break
        found += more[: count - len(found)] if found else more
        taken = np.zeros_like(left)
        for x, y, radius in more:
            add_disc(taken, x, y, radius / START_RADIUS_FRACTION)
        left &= ~taken
    return tuple(found)


def _discs_in(region: Mask, part: Mask | None = None) -> list[Circle]:
    """A disc in each component of a region, or of a part of it, where the region is deepest, if there is room for one."""
    parts = connected_parts(region if part is None else part)
    return [one for one in discs(region, parts, np.flatnonzero(parts.areas), np.inf) if one[2] >= 1]
