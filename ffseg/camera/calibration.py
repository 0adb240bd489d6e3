"""Camera files: the YAML of the contract, and OpenCV and OCamCalib files read directly."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ffseg.camera import ocam_files, opencv_files
from ffseg.camera.model import Camera
from ffseg.camera.projections import Affine, Fisheye, Polynomial, Projection, UnifiedSphere
from ffseg.errors import CalibrationError
from ffseg.schema.kinds import FilePath, Flag, Integer, Many, Number, Row, Text
from ffseg.schema.nodes import Node, Origin, Problems
from ffseg.schema.sections import Section, collect, declarations, declared
from ffseg.schema.strict_text import read_text
from ffseg.schema.strict_yaml import parse

MODELS = ("unified", "omnidir", "fisheye", "ocam")
MAX_SIDE = 65_500
"""Pixels; no image reader here takes a longer side."""
LENS_KEYS = ("fx", "fy", "cx", "cy")
MOUNTING = ("mount_height", "robot_radius", "rim_radius", "footprint", "mirrored", "forward")

_NO_XI = "model fisheye has none; leave it out, or name model omnidir"
_FOCAL = Number(0, 1e6, above=True)
_PIXEL = Number(-1e6, 1e6)
_MAX_HEIGHT = 150
"""Metres: higher than a drone may fly (120 m in the EU), less than the height of any mast in millimetres."""
_COEFFICIENT = Number(-1e6, 1e6)
_FOUR = Row(("k1", "k2", "p1 or k3", "p2 or k4"), (_COEFFICIENT,) * 4)
_THREE = Row(("1st", "2nd", "3rd"), (_COEFFICIENT,) * 3)


@dataclass(frozen=True, slots=True)
class CameraFile(Section):
    """Keys of a camera file."""

    model: str = declared("unified", Text(MODELS), "projection model")
    file: str | None = declared(None, FilePath(), "OpenCV YAML/XML or OCamCalib text that holds the lens")
    width: int = declared(1, Integer(1, MAX_SIDE), "image width, px")
    height: int = declared(1, Integer(1, MAX_SIDE), "image height, px")
    xi: float = declared(0.0, Number(0, 100), "mirror parameter")
    fx: float = declared(1.0, _FOCAL, "focal length, px")
    fy: float = declared(1.0, _FOCAL, "focal length, px")
    cx: float = declared(0.0, _PIXEL, "principal point, px")
    cy: float = declared(0.0, _PIXEL, "principal point, px")
    skew: float = declared(0.0, _PIXEL, "K[0, 1], px")
    distortion: tuple[float, ...] = declared((0.0,) * 4, _FOUR, "k1, k2, p1, p2; fisheye: k1 to k4")
    K: tuple[tuple[float, ...], ...] = declared(
        (), Many(_THREE, 3, distinct=False), "camera matrix instead of fx, fy, cx, cy, skew"
    )
    D: tuple[float, ...] = declared((0.0,) * 4, _FOUR, "another name of distortion")
    mount_height: float = declared(1.0, Number(0, _MAX_HEIGHT, above=True), "metres above the ground, not millimetres")
    up: tuple[float, ...] = declared((0.0, 0.0, -1.0), _THREE, "unit vector to the sky")
    robot_radius: float = declared(0.0, Number(0, MAX_SIDE), "disc in which the camera sees itself, px")
    rim_radius: float = declared(1.0, Number(0, MAX_SIDE, above=True), "end of the scene, px")
    footprint: float = declared(
        0.0, Number(0, 100), "radius of the robot on the ground, m; 0 = passages are not closed"
    )
    mirrored: bool = declared(True, Flag(), "the image is turned over against the view from above, as by a mirror")
    forward: float = declared(0.0, Number(-360, 360), "degrees from x toward y of the image to the robot's front")


SEE_ALL = f"; the keys are {', '.join(key for key, _, _ in declarations(CameraFile))}"


def load_camera(path: str | os.PathLike[str]) -> Camera:
    """Read a camera file.

    Parameters
    ----------
    path : path
        The contract's YAML; an OpenCV YAML or XML file of an omnidirectional or fisheye calibration; or OCamCalib's
        ``calib_results.txt``. The last three say nothing of the mounting: ``mount_height`` is then None.

    Raises
    ------
    CalibrationError
        One line for each thing wrong, with file, line and key.

    Examples
    --------
    >>> camera = ffseg.load_camera("pictures/pair/camera.yaml")
    >>> camera.width, camera.height, camera.mount_height
    (800, 600, 0.9)
    """
    problems = Problems()
    text = read_text(os.fspath(path), problems)
    problems.raise_as(CalibrationError)
    source = Origin(os.fspath(path), os.path.dirname(os.fspath(path)))
    camera = _from_text(text, source, problems)
    problems.raise_as(CalibrationError)
    if camera is None:
        raise CalibrationError(f"{source.name}: no camera in this file; see docs/omnidirectional.md for the formats")
    return camera


def load_mounted_camera(path: str | os.PathLike[str]) -> Camera:
    """Read a camera file that also says how high the camera is mounted, which altitudes need.

    Raises
    ------
    CalibrationError
        As `load_camera`, and when the height is missing: the remedy depends on what kind of file it is.
    """
    camera, name = load_camera(path), os.fspath(path)
    if camera.mount_height is not None:
        return camera
    text = read_text(name, Problems())
    if not (ocam_files.looks_like(text) or opencv_files.looks_like(text)):
        raise CalibrationError(f"{name}: mount_height: missing; altitudes need it: add 'mount_height: METRES'")
    kinds = {Polynomial: "ocam", Fisheye: "fisheye"}
    model = kinds.get(type(camera.projection), "omnidir")
    raise CalibrationError(
        f"{name}: holds the lens alone, and altitudes need the height of the camera; name a YAML file of three lines instead: "
        f"'model: {model}', 'file: {os.path.basename(name)}', 'mount_height: METRES'"
    )


def _from_text(text: str, source: Origin, problems: Problems) -> Camera | None:
    if ocam_files.looks_like(text):
        return ocam_files.read(text, source.name, problems)
    if opencv_files.looks_like(text):
        return _opencv(opencv_files.read(text, source, problems), None, problems)
    root = parse(text, source, problems)
    if not isinstance(root.value, dict):
        if not problems.lines:
            problems.add(source.name, "the file must be a mapping of keys to values, such as 'model: unified'")
        return None
    return _from_yaml(root, problems)


def _from_yaml(root: Node, problems: Problems) -> Camera | None:
    values: dict[str, Any] = collect(CameraFile, root, problems, SEE_ALL)
    if "model" not in values and "model" not in dict(root.value if isinstance(root.value, dict) else {}):
        _missing(root, "model", problems)
    lens = _lens(root, values, problems) if not problems.lines else None
    up = np.array(values.get("up", (0.0, 0.0, -1.0)))
    length = float(np.linalg.norm(up))
    if length < 1e-6:
        problems.add(_place(root, "up"), "up: the vector has no direction; write [0, 0, -1] for a level camera")
    rim = values.get("rim_radius")
    if rim is not None and rim <= values.get("robot_radius", 0.0):
        problems.add(_place(root, "rim_radius"), "rim_radius: must exceed robot_radius, nothing is left between")
    if lens is None or problems.lines:
        return None
    return replace(lens, up=up / length, **{key: values[key] for key in MOUNTING if key in values})


def _lens(root: Node, values: dict[str, Any], problems: Problems) -> Camera | None:
    """The camera that the file's lens makes, mounted nowhere."""
    if values["model"] == "ocam" and values.get("file") is None:
        problems.add(_place(root, "file"), "file: missing; model ocam needs the name of an OCamCalib calib_results.txt")
        return None
    if values.get("file") is not None:
        return _lens_file(root, values, problems)
    return _inline(root, values, problems)


def _lens_file(root: Node, values: dict[str, Any], problems: Problems) -> Camera | None:
    """Read the file named by ``file:``; keys that it holds may not be given beside it, but for the size."""
    for key in ("xi", *LENS_KEYS, "skew", "distortion", "K", "D"):
        if key in values:
            problems.add(_place(root, key), f"{key}: given here and by file; keep one")
    name: str = values["file"]
    text = read_text(name, problems)
    if problems.lines:
        return None
    if values["model"] == "ocam":
        lens = ocam_files.read(text, name, problems)
    else:
        lens = _opencv(opencv_files.read(text, Origin(name, ""), problems), values["model"], problems)
    if lens is not None:
        for key, own in (("width", lens.width), ("height", lens.height)):
            if values.get(key, own) != own:
                problems.add(_place(root, key), f"{key}: {values[key]} here, {own} in {name}; they must agree")
    return lens


def _inline(root: Node, values: dict[str, Any], problems: Problems) -> Camera | None:
    model = values["model"]
    needed = ["width", "height"] + (["xi"] if model != "fisheye" else []) + ([] if "K" in values else list(LENS_KEYS))
    for key in needed:
        if key not in values:
            _missing(root, key, problems, model)
    if model == "fisheye" and "xi" in values:
        problems.add(_place(root, "xi"), f"xi: {_NO_XI}")
    for key, other in (("D", "distortion"), *(("K", name) for name in (*LENS_KEYS, "skew"))):
        if key in values and other in values:
            problems.add(_place(root, other), f"{other}: given beside {key}; keep one")
    affine = affine_of(values["K"], _place(root, "K"), "K", problems) if "K" in values else None
    if problems.lines:
        return None
    affine = affine or Affine(values["fx"], values["fy"], values["cx"], values["cy"], values.get("skew", 0.0))
    distortion = values.get("D", values.get("distortion", (0.0,) * 4))
    return lens_of(model, affine, values.get("xi"), distortion, (values["width"], values["height"]))


def affine_of(rows: tuple[tuple[float, ...], ...], where: str, key: str, problems: Problems) -> Affine | None:
    """K as an affine step, or None with the problem noted."""
    if len(rows) != 3 or rows[1][0] != 0 or tuple(rows[2]) != (0.0, 0.0, 1.0) or rows[0][0] <= 0 or rows[1][1] <= 0:
        problems.add(where, f"{key}: is not a camera matrix; write [[fx, skew, cx], [0, fy, cy], [0, 0, 1]]")
        return None
    return Affine(rows[0][0], rows[1][1], rows[0][2], rows[1][2], rows[0][1])


def lens_of(
    model: str, affine: Affine, xi: float | None, distortion: tuple[float, ...], size: tuple[int, int]
) -> Camera:
    """Build the camera of a sphere or fisheye model."""
    four = (float(distortion[0]), float(distortion[1]), float(distortion[2]), float(distortion[3]))
    projection: Projection = UnifiedSphere(affine, float(xi or 0), four)
    if model == "fisheye":
        projection = Fisheye(affine, four)
    return Camera(projection, *size, (affine.cx, affine.cy))


def _opencv(values: opencv_files.Values | None, model: str | None, problems: Problems) -> Camera | None:
    """A camera from OpenCV's keys; without a model, ``xi`` tells an omnidir file and ``fisheye_model`` a fisheye."""
    if values is None:
        return None
    model = model or ("omnidir" if values.xi is not None else "fisheye" if values.fisheye else None)
    if model is None:
        problems.add(
            values.name, "neither xi (omnidir) nor fisheye_model is there; name the model in a camera file with 'file:'"
        )
    if model in ("unified", "omnidir") and values.xi is None:
        problems.add(values.name, f"xi: missing; model {model} needs it")
    if model == "fisheye" and values.xi is not None:
        problems.add(values.name, f"xi: {_NO_XI}")
    if len(values.distortion) != 4:
        problems.add(values.name, f"distortion: {len(values.distortion)} coefficients; omnidir and fisheye have 4")
    affine = affine_of(values.matrix, values.name, "camera_matrix", problems)
    if affine is None or model is None or problems.lines:
        return None
    return lens_of(model, affine, values.xi, values.distortion, values.size)


def _missing(root: Node, key: str, problems: Problems, model: str = "") -> None:
    needs = f"model {model} needs it" if model else "write one of " + ", ".join(MODELS)
    problems.add(root.source.name, f"{key}: missing; {needs}")


def _place(root: Node, key: str) -> str:
    node = root.value.get(key) if isinstance(root.value, dict) else None
    return node.where if isinstance(node, Node) else root.source.name
