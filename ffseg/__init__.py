"""Free-form active contours: batch image segmentation and free-space perception.

The names below are loaded when first used, so that ``import ffseg`` costs nothing.
"""

from __future__ import annotations

import os
import sys
from importlib import import_module
from importlib.machinery import PathFinder
from importlib.util import module_from_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ffseg.api import segment as segment
    from ffseg.camera.calibration import load_camera as load_camera
    from ffseg.camera.footprint import Footprint as Footprint
    from ffseg.camera.model import Camera as Camera
    from ffseg.camera.motion import Motion as Motion
    from ffseg.camera.motion import Pose as Pose
    from ffseg.camera.motion import planar_pose as planar_pose
    from ffseg.camera.poses import load_poses as load_poses
    from ffseg.camera.projections import Projection as Projection
    from ffseg.errors import CalibrationError as CalibrationError
    from ffseg.errors import FfsegError as FfsegError
    from ffseg.errors import ImageReadError as ImageReadError
    from ffseg.errors import OutputError as OutputError
    from ffseg.errors import ParameterError as ParameterError
    from ffseg.errors import SegmentationError as SegmentationError
    from ffseg.errors import UsageError as UsageError
    from ffseg.freespace.motion.ground import Doubt as Doubt
    from ffseg.freespace.motion.ground import GroundFit as GroundFit
    from ffseg.freespace.occupancy import OccupancyMap as OccupancyMap
    from ffseg.freespace.outline import Ground as Ground
    from ffseg.freespace.outline import Scan as Scan
    from ffseg.freespace.sequence import Frame as Frame
    from ffseg.freespace.sequence import Sequence as Sequence
    from ffseg.freespace.sightings import Station as Station
    from ffseg.freespace.skeleton import Edge as Edge
    from ffseg.freespace.skeleton import Node as Node
    from ffseg.freespace.skeleton import Skeleton as Skeleton
    from ffseg.freespace.structural import ComponentVerdict as ComponentVerdict
    from ffseg.freespace.window import Link as Link
    from ffseg.geometry.freeform import FreeForm as FreeForm
    from ffseg.image.edges import EdgeMap as EdgeMap
    from ffseg.image.edges import ScoreCalibration as ScoreCalibration
    from ffseg.image.edges import edge_map as edge_map
    from ffseg.image.own import own_image as own_image
    from ffseg.io.images import Limits as Limits
    from ffseg.io.images import read_image as read_image
    from ffseg.parameter_files import ParametersLike as ParametersLike
    from ffseg.parameter_files import load_params as load_params
    from ffseg.parameter_files import presets as presets
    from ffseg.parameters import Contour as Contour
    from ffseg.parameters import Domain as Domain
    from ffseg.parameters import Edges as Edges
    from ffseg.parameters import Init as Init
    from ffseg.parameters import Input as Input
    from ffseg.parameters import LevelSet as LevelSet
    from ffseg.parameters import Network as Network
    from ffseg.parameters import Obstacles as Obstacles
    from ffseg.parameters import Paper as Paper
    from ffseg.parameters import Parameters as Parameters
    from ffseg.parameters import Region as Region
    from ffseg.parameters import Snake as Snake
    from ffseg.picking.notebook import Picking as Picking
    from ffseg.picking.notebook import pick as pick
    from ffseg.plugins import Method as Method
    from ffseg.result import Segmentation as Segmentation
    from ffseg.result import Timings as Timings
    from ffseg.scene import Outcome as Outcome
    from ffseg.scene import Progress as Progress
    from ffseg.scene import Scene as Scene
    from ffseg.scene import Segmenter as Segmenter
    from ffseg.scene import Stats as Stats

__version__ = "0.2.0"

_NAMES = {
    "ffseg.api": "segment",
    "ffseg.picking.notebook": "pick Picking",
    "ffseg.parameter_files": "ParametersLike load_params presets",
    "ffseg.parameters": "Parameters Contour Edges Init Input Domain Obstacles Snake LevelSet Paper Region Network",
    "ffseg.result": "Segmentation Timings",
    "ffseg.scene": "Stats Progress Segmenter Outcome Scene",
    "ffseg.plugins": "Method",
    "ffseg.image.edges": "EdgeMap ScoreCalibration edge_map",
    "ffseg.image.own": "own_image",
    "ffseg.geometry.freeform": "FreeForm",
    "ffseg.camera.calibration": "load_camera",
    "ffseg.camera.model": "Camera",
    "ffseg.camera.motion": "Pose planar_pose Motion",
    "ffseg.camera.poses": "load_poses",
    "ffseg.freespace.sequence": "Sequence Frame",
    "ffseg.freespace.outline": "Ground Scan",
    "ffseg.freespace.occupancy": "OccupancyMap",
    "ffseg.freespace.sightings": "Station",
    "ffseg.freespace.skeleton": "Skeleton Node Edge",
    "ffseg.freespace.structural": "ComponentVerdict",
    "ffseg.io.images": "read_image Limits",
    "ffseg.errors": (
        "FfsegError ParameterError UsageError ImageReadError SegmentationError CalibrationError OutputError"
    ),
    "ffseg.camera.footprint": "Footprint",
    "ffseg.camera.projections": "Projection",
    "ffseg.freespace.window": "Link",
    "ffseg.freespace.motion.ground": "GroundFit Doubt",
}
"""Public names by the module that holds them."""
_HOMES = {name: home for home, names in _NAMES.items() for name in names.split()}

__all__ = ["__version__", *_HOMES]  # noqa: PLE0604 - the names are strings, in one place


def __getattr__(name: str) -> object:
    """Load a public name from its home (PEP 562)."""
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'ffseg' has no attribute {name!r}")
    value = getattr(import_module(home), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


def _has_core(package: str) -> bool:
    """Whether a copy of this package holds the compiled core."""
    try:
        names = os.listdir(os.path.join(package, "native"))
    except OSError:
        return False
    return any(name.startswith("_core.") and not name.endswith(".pyi") for name in names)


def _give_way() -> None:
    """Let the first complete copy of the package on the path take the place of this one, if there is one.

    Python run in a folder with the sources finds these before the installed package, and they hold no compiled core.
    """
    for place in sys.path:
        spec = PathFinder.find_spec("ffseg", [place]) if _has_core(os.path.join(place, "ffseg")) else None
        if spec is not None and spec.loader is not None:
            sys.modules["ffseg"] = module_from_spec(spec)
            spec.loader.exec_module(sys.modules["ffseg"])
            return


if not any(map(_has_core, __path__)):
    _give_way()
