"""Poses files: CSV ``image,x,y,theta`` and TUM trajectories; pairs files: CSV ``previous,current``."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence

import numpy as np

from ffseg.camera.model import Camera
from ffseg.camera.motion import Pose, planar_pose, require_camera
from ffseg.errors import CalibrationError
from ffseg.schema.nodes import Problems
from ffseg.schema.strict_csv import finite, read_table, rows_of

POSE_HEADER = ["image", "x", "y", "theta"]
SIGMA_HEADER = [*POSE_HEADER, "sigma_xy", "sigma_theta"]
PAIR_HEADER = ["previous", "current"]
MAX_METRES = 1e7
"""Positions beyond this (UTM coordinates stay below) are a slip of units and would cost the last digits."""
NORM_SLACK = 1e-2
"""How far a quaternion's norm may be from 1: four decimals in the file make 1e-4."""


def load_poses(path: str | os.PathLike[str], images: Sequence[str], camera: Camera) -> Mapping[str, Pose]:
    """Read the poses of images.

    Parameters
    ----------
    path : path
        CSV with the header ``image,x,y,theta`` (rows in any order, found by name), which may end with
        ``sigma_xy,sigma_theta`` (standard deviations, metres per axis and radians), or a TUM trajectory
        (``timestamp tx ty tz qx qy qz qw``) with one line per image in image order.
    images : sequence of str
        Relative names of the images, in order, with ``/``.
    camera : Camera
        Its ``up`` turns planar poses into poses of the tilted camera.

    Returns
    -------
    mapping of str to Pose
        Without the images that have no row; rows of other images are ignored.

    Raises
    ------
    CalibrationError
        One line for each thing wrong, with file and line; also when no image has a row.

    Examples
    --------
    >>> camera = ffseg.load_camera("pictures/pair/camera.yaml")
    >>> poses = ffseg.load_poses("pictures/pair/poses.csv", ["0001.png", "0002.png"], camera)
    >>> sorted(poses), poses["0002.png"].position
    (['0001.png', '0002.png'], array([0., 0., 0.]))
    """
    require_camera(camera)
    if isinstance(images, str):
        raise CalibrationError(f"images is the text {images!r}; give a list of names: [{images!r}]")
    name, problems = os.fspath(path), Problems()
    text = read_table(name, CalibrationError)
    head = text.lstrip("\ufeff \t\r\n").partition("\n")[0].rstrip()
    if [cell.strip() for cell in head.split(",")] in (POSE_HEADER, SIGMA_HEADER):
        poses = _csv_poses(text, name, camera, problems)
    elif "," in head or ";" in head.partition("#")[0]:
        apart = "" if "," in head else ", apart by commas"
        raise CalibrationError(
            f"{name}:1: the header must be image,x,y,theta[,sigma_xy,sigma_theta]{apart}, it is {head[:60]!r}"
        )
    else:
        poses = _tum_poses(text, name, images, problems)
    problems.raise_as(CalibrationError)
    found = {image: poses[image] for image in images if image in poses}
    if images and not found:
        raise CalibrationError(
            f"{name}: no row names any of the {len(images)} images; names are relative, such as {images[0]!r}"
        )
    return found


def load_pairs(path: str | os.PathLike[str], images: Sequence[str]) -> Mapping[str, str]:
    """Read the pairs file.

    Returns
    -------
    mapping of str to str
        Previous image by current image.

    Raises
    ------
    CalibrationError
        One line for each thing wrong: header, unknown image, an image paired with itself or given two predecessors.
    """
    name, problems = os.fspath(path), Problems()
    text = read_table(name, CalibrationError)
    pairs: dict[str, str] = {}
    known = set(images)
    for line, row in rows_of(text, name, [PAIR_HEADER], problems):
        previous, current = row
        for image in row:
            if image not in known:
                problems.add(f"{name}:{line}", f"{image!r} is not among the images; names are relative to the input")
        if previous == current:
            problems.add(f"{name}:{line}", f"{current!r} is paired with itself; name another previous image")
        if current in pairs:
            problems.add(f"{name}:{line}", f"{current!r} has a previous image already; keep one row")
        pairs[current] = previous
    problems.raise_as(CalibrationError)
    return pairs


def _csv_poses(text: str, name: str, camera: Camera, problems: Problems) -> dict[str, Pose]:
    poses: dict[str, Pose] = {}
    for line, (image, *words) in rows_of(text, name, [POSE_HEADER, SIGMA_HEADER], problems):
        values = _floats(words, f"{name}:{line}", SIGMA_HEADER[1 : 1 + len(words)], problems)
        if image in poses:
            problems.add(f"{name}:{line}", f"{image!r} has a pose already; keep one row")
        if values is None:
            continue
        sigmas = (values[3], values[4]) if len(values) > 3 else None
        if sigmas and min(sigmas) <= 0.0:
            problems.add(f"{name}:{line}", "sigma_xy and sigma_theta must be above 0; leave the columns out if unknown")
            continue
        poses[image] = planar_pose(camera, values[0], values[1], values[2], sigmas)
    return poses


def _tum_poses(text: str, name: str, images: Sequence[str], problems: Problems) -> dict[str, Pose]:
    names = ["timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw"]
    rows: list[tuple[int, list[float]]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        if len(words) != len(names):
            problems.add(f"{name}:{number}", f"{len(words)} values; a TUM line has 8: {' '.join(names)}")
            continue
        values = _floats(words, f"{name}:{number}", names, problems)
        if values is None:
            continue
        if rows and values[0] <= rows[-1][1][0]:
            problems.add(f"{name}:{number}", "timestamp: not later than the line before; poses must be in image order")
        if abs(math.hypot(*values[4:]) - 1.0) > NORM_SLACK:
            problems.add(f"{name}:{number}", "qx qy qz qw: not a unit quaternion; check the order of the columns")
        rows.append((number, values))
    if not problems.lines and len(rows) != len(images):
        problems.add(name, f"{len(rows)} poses for {len(images)} images; a TUM trajectory has one per image in order")
    if problems.lines:
        return {}
    return {image: _tum_pose(values) for image, (_, values) in zip(images, rows, strict=True)}


def _tum_pose(values: list[float]) -> Pose:
    x, y, z, w = np.array(values[4:]) / math.hypot(*values[4:])
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    return Pose(rotation, np.array(values[1:4]))


def _floats(words: list[str], where: str, names: list[str], problems: Problems) -> list[float] | None:
    values = []
    for word, key in zip(words, names, strict=True):
        limit = 1e300 if key == "timestamp" else MAX_METRES
        value = finite(word, limit)
        if math.isnan(value):
            problems.add(where, f"{key}: {word[:40]!r} is not a finite number up to {limit:g}")
        values.append(value)
    return None if any(not math.isfinite(value) for value in values) else values
