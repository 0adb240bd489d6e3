"""The map of a drive and its graph of passages, from the stored results of each frame."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ffseg.batch.outputs.table import GROUND, MAP_BAG, MAP_FILES, MASK, SCAN_JSON, Output
from ffseg.batch.record.tables import in_time
from ffseg.batch.tar.members import output_bytes
from ffseg.batch.values import Record
from ffseg.batch.views import CameraSetup
from ffseg.camera.motion import Pose
from ffseg.errors import CalibrationError, ImageReadError
from ffseg.freespace.leans import Lean
from ffseg.freespace.occupancy import OccupancyMap
from ffseg.freespace.sightings import Sighting
from ffseg.freespace.skeleton import Skeleton
from ffseg.freespace.window import Link
from ffseg.io.exports import from_run_lengths
from ffseg.io.files import make_folder, printable, write_all_atomic
from ffseg.io.masks import decode_mask

MAX_REFUTED = 2
"""Frames in a row whose poses the ground contradicts, after which the last of a drive is not believed either."""
_NAMED = 1000
"""Frames that are not in the map and are named in ``run.json``; their number is always given."""


@dataclass(slots=True)
class Drive:
    """A map and what went into it."""

    grid: OccupancyMap = field(default_factory=OccupancyMap)
    ways: Skeleton = field(default_factory=lambda: Skeleton((), ()))
    frames: int = 0
    """All of the drive."""
    posed: bool = False
    """Whether there are poses."""
    lost: dict[str, str] = field(default_factory=dict)
    """Why a frame is not in the map, by its name."""
    scans: list[tuple[int, Any]] = field(default_factory=list)
    """Of the images of a bag, with their nanoseconds."""
    refuted: int = 0
    """Frames before the one that is doubted whose poses the ground contradicts, one after the other."""
    _doubted: tuple[Record, Sighting, Pose] | None = None
    """A frame whose pose the ground contradicts: it is wrong if that of the next one is contradicted as well."""

    def figures(self) -> dict[str, Any]:
        """For ``run.json``."""
        metres, radians = self.grid.drift
        named = list(self.lost.items())[:_NAMED]
        return {
            "frames": self.frames,
            "fused": self.frames - len(self.lost),
            "estimated": sum(one is not None and one.estimated for one in self.grid.stations),
            "drift_m": round(metres, 4),
            "drift_deg": round(float(np.rad2deg(radians)), 3),
            "nodes": len(self.ways.nodes),
            "edges": len(self.ways.edges),
            "loops": self.ways.num_loops,
            "lost": [{"image": name, "reason": reason} for name, reason in named],
        }

    def take(self, record: Record, out: str, views: CameraSetup) -> None:
        """Fuse one frame, or note why not."""
        name, pose = printable(record.name), views.poses.get(record.name)
        try:
            seen = _sighting(record, out, views)
            if record.name in views.stamps:
                self.scans.append((views.stamps[record.name], json.loads(_stored(record, out, SCAN_JSON))))
        except (ImageReadError, KeyError, TypeError, ValueError) as error:
            reason = f"what is stored of it cannot be read ({type(error).__name__}: {error})"
            if not any(path.startswith(f"{GROUND.folder}/") for path in record.outputs):
                reason = "it was made without --map; run it again with it"
            self.settle()
            self._lose(name, f"it failed: {record.row['error']}" if record.status == "failed" else reason)
            return
        self.settle(wrong=seen.contradicted)
        if pose is not None and seen.contradicted:
            self._doubted = record, seen, pose
        else:
            self._fuse(record, seen, pose)

    def settle(self, *, wrong: bool = False) -> None:
        """Fuse the frame that is doubted, if there is one, or leave it out."""
        doubted, self._doubted = self._doubted, None
        if doubted is not None and wrong:
            self.refuted += 1
            self._lose(printable(doubted[0].name), doubted[0].row.get("note", ""))
        elif doubted is not None:
            self.refuted = 0
            self._fuse(*doubted)

    def _fuse(self, record: Record, seen: Sighting, pose: Pose | None) -> None:
        name = printable(record.name)
        if pose is None and self.posed and not any(self.grid.stations):
            self._lose(name, "it has no pose, nor has a frame before it")
            return
        try:
            if not self.grid.fuse(name, seen, pose):
                why = "it moved since frames that are not in the map" if seen.links else record.row.get("note", "")
                self.lost[name] = f"it has no pose; {why}"
        except CalibrationError as error:
            self.lost[name] = str(error)

    def _lose(self, name: str, reason: str) -> None:
        self.grid.miss(name)
        self.lost[name] = reason

    def write(self, out: str) -> Sequence[str]:
        """Write `MAP_FILES` below an output folder, if any frame is in the map; their names."""
        if len(self.lost) == self.frames:
            return ()
        files = self.grid.files(self.ways) | self.ways.files()
        make_folder(os.path.join(out, os.path.dirname(MAP_FILES[0])))
        written = MAP_FILES
        if self.scans:
            from ffseg.io.bags import map_bag

            files["drive.mcap"] = map_bag(self.grid.levels(), self.grid.cell, self.grid.origin, self.scans)
            written = (*MAP_FILES, MAP_BAG)
        write_all_atomic([(os.path.join(out, path), files[os.path.basename(path)]) for path in written])
        return written


def drive_of(records: Iterable[Record], out: str, views: CameraSetup) -> Drive:
    """Fuse the frames of a run in the order in which they were driven.

    Parameters
    ----------
    records : iterable of Record
        All that stand.
    out : str
        Where their masks and grounds are.
    views : CameraSetup
        Whose poses place them; a frame without a pose is placed by its motion since one that has a place.
    """
    known = {record.name: record for record in records}
    drive = Drive(frames=len(known), posed=bool(views.poses))
    for name in in_time(known.values()):
        drive.take(known[name], out, views)
    drive.settle(wrong=drive.refuted >= MAX_REFUTED)
    drive.ways = drive.grid.skeleton(views.camera.footprint)
    return drive


def _stored(record: Record, out: str, kind: Output) -> bytes:
    paths = {(path.partition("/")[0], os.path.splitext(path)[1]): path for path in record.outputs}
    path = paths[kind.folder, kind.suffix]
    return output_bytes(out, path, record.members.get(path))


def _sighting(record: Record, out: str, views: CameraSetup) -> Sighting:
    """What the stored outputs of a frame say.

    Raises
    ------
    ImageReadError, KeyError, TypeError, ValueError
        When they are gone, or say nothing of how the camera stood.
    """
    mask, ground = (_stored(record, out, kind) for kind in (MASK, GROUND))
    state: Mapping[str, Any] = json.loads(ground)["camera"]
    links = tuple(
        Link(str(one), (float(x), float(y), float(turn)), (float(nod_x), float(nod_y)))
        for one, x, y, turn, nod_x, nod_y in state["moved"]
    )
    sigma_m, sigma_rad = map(float, state["sigmas"])
    lean = None if state["lean"] is None else Lean(*map(float, state["lean"]))
    inside, domain = views.camera.domain(), None
    if "left_out" in state:
        domain = inside & ~from_run_lengths(state["left_out"], inside.shape)
    return Sighting(decode_mask(mask), views.camera, links, (sigma_m, sigma_rad), lean, domain, "contradicted" in state)
