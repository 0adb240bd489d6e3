"""Networks in ONNX files, run by OpenCV: an image to a map of probability or edge strength."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from ffseg.arrays import Image, Plane
from ffseg.errors import said
from ffseg.parameters import Network

Net = Any
"""OpenCV's class has no type."""


def load_net(data: bytes) -> Net:
    """The network in an ONNX file.

    Raises
    ------
    ValueError
        If OpenCV cannot load it.
    """
    try:
        return cv2.dnn.readNetFromONNX(np.frombuffer(data, np.uint8))
    except cv2.error as error:
        raise ValueError(f"it is no network that OpenCV {cv2.__version__} can load; export it as ONNX") from error


TRIAL_SECONDS = 120
"""Ten times what the largest networks that are sensible here take to be read and run once."""
_TRIAL = "import sys; sys.path[:] = {path!r}; from ffseg.image.onnx import trial; trial({file!r}, {size!r})"
_TRIAL_SIDE = 64
"""Pixels of the blank image of a trial."""


def require_harmless(path: str, params: Network) -> None:
    """Read and run a network in a process of its own first: a damaged one can end the process that does it.

    Raises
    ------
    ValueError
        If it ends that process, holds it too long, or cannot be loaded.
    """
    code = _TRIAL.format(path=sys.path, file=os.fsencode(path), size=params.size)
    command = [sys.executable, "-P", "-c", code]
    try:
        done = subprocess.run(  # noqa: S603 - our own interpreter with our own code
            command, stdin=subprocess.DEVNULL, capture_output=True, timeout=TRIAL_SECONDS, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise ValueError(f"OpenCV reads it for more than {TRIAL_SECONDS} s; export it as ONNX again") from error
    if done.returncode < 0:
        name = signal.Signals(-done.returncode).name
        raise ValueError(f"reading or running it ends OpenCV ({name}): it is damaged; export it as ONNX again")
    if done.stdout or done.returncode:
        raise ValueError(done.stdout.decode("utf-8", "replace").strip() or "it cannot be read; export it as ONNX again")


def trial(path: bytes, size: Any) -> None:  # noqa: ANN401 - of `Network`
    """Load a network and run it on a blank image; print why it cannot be loaded. What it says of an image is no matter."""
    os.environ["OPENCV_LOG_LEVEL"] = "SILENT"
    with open(path, "rb") as file:  # noqa: PTH123 - bytes
        data = file.read()
    try:
        net = load_net(data)
    except ValueError as error:
        sys.stdout.write(str(error))
        return
    with contextlib.suppress(ValueError):  # an image of its own size may do
        map_of(np.zeros((_TRIAL_SIDE, _TRIAL_SIDE, 3), np.uint8), net, replace(Network(), size=size))


def map_of(image: Image, net: Net, params: Network) -> Plane:
    """What a network says of each pixel of an image.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
        Grey or BGR.
    net : Net
        Its input is (1, 3, h, w).
    params : Network
        How the input is made, and what of the output is taken.

    Returns
    -------
    ndarray of float32, shape (H, W)
        From 0 to 1.

    Raises
    ------
    ValueError
        If the network does not take such an input, or gives no map.
    """
    colour = image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    height, width = image.shape[:2]
    size = (width, height) if params.size == "auto" else (round(params.size[0]), round(params.size[1]))
    mean = params.mean if params.rgb else params.mean[::-1]
    try:
        net.setInput(cv2.dnn.blobFromImage(colour, params.scale, size, mean, swapRB=params.rgb))
        found = np.asarray(net.forward() if params.output == "last" else net.forward(params.output), np.float32)
    except cv2.error as error:
        raise ValueError(
            f"it cannot be run on this image ({said(error)}); check network.size and network.output"
        ) from error
    plane = _plane(found, params)
    scaled = cv2.resize(plane, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.ascontiguousarray(np.clip(scaled, 0, 1), np.float32)


def _plane(found: Plane, params: Network) -> Plane:
    """The map of one channel of the output, as probability."""
    channels = found[0] if found.ndim == 4 and found.shape[0] == 1 else found
    channels = channels[None] if channels.ndim == 2 else channels
    if channels.ndim != 3 or params.channel >= len(channels) or not np.isfinite(channels).all():
        raise ValueError(
            f"its output of shape {found.shape} holds no finite map number {params.channel}; check network.output and "
            "network.channel"
        )
    if params.activation == "softmax":
        powers = np.exp(channels - channels.max(axis=0))
        channels = powers / powers.sum(axis=0)
    plane = np.ascontiguousarray(channels[params.channel])
    if params.activation == "logistic":
        plane = 1 / (1 + np.exp(-np.clip(plane, -60, 60)))
    return np.asarray(plane, np.float32)
