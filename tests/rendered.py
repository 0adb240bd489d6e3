"""Rendered pairs and drives, each rendered once in a test run, whichever of its processes asks first: one takes two seconds."""

import os
import pickle
from collections.abc import Callable, Iterable, Sequence
from functools import cache, wraps
from pathlib import Path
from typing import ParamSpec, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.camera.model import Camera
from ffseg.freespace.sequence import view_scene
from ffseg.io.files import write_bytes_atomic
from ffseg.parameters import Parameters
from ffseg.pipeline import segment
from ffseg.rendering import pairs
from ffseg.rendering.raycast import Rendering
from ffseg.result import Segmentation
from ffseg.scene import Scene
from tests import floors

FOLDER = "FFSEG_RENDERED"
"""Environment variable with the folder that the processes of a test run share."""
P, T = ParamSpec("P"), TypeVar("T")


def once(make: Callable[P, T]) -> Callable[P, T]:
    """The same function, whose values are kept in the folder that the processes share, if there is one."""

    @cache
    @wraps(make)
    def kept(*arguments: P.args, **options: P.kwargs) -> T:
        folder = os.environ.get(FOLDER)
        path = Path(folder or ".", f"{make.__name__}{arguments}{options}.pickle")
        if not folder or not path.exists():
            value = make(*arguments, **options)
            if folder:
                write_bytes_atomic(path, pickle.dumps(value))
            return value
        return pickle.loads(path.read_bytes())  # our own

    return kept


def write_views(
    folder: Path,
    shown: Iterable[Rendering],
    poses: Sequence[pairs.PlanarPose],
    names: Sequence[str],
    camera: str = pairs.CAMERA_YAML,
) -> None:
    """Write images into ``views``, and their camera and their poses beside it."""
    (folder / "views").mkdir()
    for name, view in zip(names, shown, strict=True):
        cv2.imwrite(str(folder / "views" / name), view.image)
    (folder / "camera.yaml").write_text(camera)
    (folder / "poses.csv").write_text(pairs.poses_csv(poses, names))


def write_pair(folder: Path) -> None:
    """Write a pair as images called 1 and 2, with its camera and its poses."""
    pair = render_pair(4)
    write_views(folder, (pair.previous, pair.current), pair.poses, ("1.png", "2.png"))


def segment_view(image: NDArray[np.uint8], camera: Camera, params: Parameters) -> Segmentation:
    """Segment one omnidirectional image, without the structural test."""
    return segment(view_scene(Scene(image, params), camera))


render_pair = once(pairs.render_pair)
floor_pair = once(floors.floor_pair)


def plain_pair() -> pairs.RenderedPair:
    return floor_pair(100_003, "plain", 1.0, 1.0)


@once
def drive() -> pairs.RenderedSequence:
    """Four views of a drive over a textured floor."""
    return floors.floor_sequence(990_003, 4, 2.0, 1.0)
