"""``ffseg.pick``: the page of `ffseg pick` in a notebook, or beside any program."""

from __future__ import annotations

import atexit
import os
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffseg.errors import UsageError
from ffseg.image.checked import Pixels, taken_image
from ffseg.io.files import make_folder, printable, read_bytes, write_bytes_atomic
from ffseg.io.masks import decode_mask, encode_png
from ffseg.parameter_files import ParametersLike, parameter_set
from ffseg.picking.project import MAX_BYTES, Project
from ffseg.picking.server import Server
from ffseg.picking.session import Session

HEIGHT = 720
"""Pixels of the frame in a notebook."""

Images = str | os.PathLike[str] | Pixels | Sequence[str | os.PathLike[str] | Pixels]


class Picking:
    """A page that is open for picking; in a notebook it shows itself as a frame.

    Attributes
    ----------
    address : str
        Of the page, on this machine.
    out : str
        Folder that everything is saved in, as `ffseg pick` does.

    Examples
    --------
    >>> with ffseg.pick("pictures/toy.png", out="picked") as picking:
    ...     picking.starts()
    {}
    """

    def __init__(self, session: Session) -> None:
        self._session, self._server = session, Server(session, framed=True)
        self._server.begin()
        atexit.register(self.close)
        self.address, self.out = self._server.address, session.out

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.address}" width="100%" height="{HEIGHT}" style="border:0"></iframe>'

    def _project(self, label: int) -> Project:
        projects = self._session.projects
        if not 0 <= label < len(projects):
            raise UsageError(f"label: {label} is the place of no class; there are {len(projects)}, from 0")
        return projects[label]

    def starts(self, label: int = 0) -> dict[str, dict[str, Any]]:
        """What was picked so far, by the name of the image.

        Parameters
        ----------
        label : int
            Place of the class in `labels`.

        Returns
        -------
        dict
            Of each image ``starts`` (x, y, radius), ``nots`` (the same, and how many starts there were before), ``boxes``
            (left, top, right, bottom), all in pixels, ``strokes``, ``probability``, ``clearance``, ``alike`` and ``status``.
        """
        tracks = self._project(label).journal.tracks
        return {name: asdict(track.now) for name, track in tracks.items() if track.version}

    def masks(self, label: int = 0) -> dict[str, NDArray[np.bool_]]:
        """Masks of the accepted images, each of shape (H, W), by the name of the image."""
        project = self._project(label)
        names = project.journal.names(lambda track: track.now.status == "accepted")
        return {name: decode_mask(read_bytes(project.mask_path(name), MAX_BYTES)) for name in names}

    def close(self) -> None:
        """End the server, as the end of the program does; what was picked stays in `out`."""
        atexit.unregister(self.close)
        self._server.shutdown()
        self._server.server_close()
        self._session.close()

    def __enter__(self) -> Picking:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()


def pick(
    images: Images,
    params: ParametersLike = None,
    *,
    out: str | os.PathLike[str] | None = None,
    labels: str | Sequence[str] = (),
    rgb: bool = False,
) -> Picking:
    """Open a page to pick regions in images with clicks, boxes and a brush.

    Parameters
    ----------
    images : str, path or ndarray, shape (H, W) or (H, W, 3), or sequence of them
        Files and folders, or images as `ffseg.segment` takes them; arrays are called ``0.png``, ``1.png``, ...
    params : Parameters, str, path or mapping, optional
        As of `ffseg.segment`.
    out : path, optional
        Folder that everything is saved in, and gone on from; without it a temporary one.
    labels : str or sequence of str
        Names of classes, each picked by itself.
    rgb : bool
        The channels of arrays are red, green, blue.

    Returns
    -------
    Picking
        In a notebook, the last expression of a cell shows the page; elsewhere open its ``address``.

    Raises
    ------
    UsageError
        If there is no image, another session holds the folder, or it holds what was picked in other arrays.
    SegmentationError
        If an array is no image.

    Examples
    --------
    >>> with ffseg.pick("pictures/toy.png", out="picked") as picking:
    ...     picking.masks(), picking.address.startswith("http://127.0.0.1:")
    ({}, True)
    """
    target = os.fspath(out) if out is not None else tempfile.mkdtemp(prefix="ffseg-pick-")
    if not isinstance(images, str | os.PathLike | np.ndarray | Sequence):
        raise UsageError(
            f"images is of type {type(images).__name__}; give a folder, a file, an array, or a list of them"
        )
    entries = [images] if isinstance(images, str | os.PathLike | np.ndarray) else list(images)
    inputs = [os.fspath(one) for one in entries if isinstance(one, str | os.PathLike)]
    chosen = parameter_set(params)
    arrays = [taken_image(one, rgb, chosen.input.range) for one in entries if not isinstance(one, str | os.PathLike)]
    if arrays:
        folder = os.path.join(target, "images")
        make_folder(folder)
        for number, image in enumerate(arrays):
            path, data = os.path.join(folder, f"{number}.png"), encode_png(image, [])
            if os.path.exists(path) and read_bytes(path, MAX_BYTES) != data:
                raise UsageError(
                    f"{printable(path)} is another array, in which was picked; name another folder with out"
                )
            write_bytes_atomic(path, data)
            inputs.append(path)
    return Picking(Session(inputs, target, chosen, [labels] if isinstance(labels, str) else labels))
