"""The picks of one class: its journal, and the files derived from it."""

from __future__ import annotations

import contextlib
import json
import os
import shlex
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import replace
from hashlib import blake2b
from pathlib import Path

import numpy as np

from ffseg.arrays import Mask
from ffseg.batch.outputs.encoding import path_from
from ffseg.batch.plan.sources import InputImage
from ffseg.batch.report.folder import OutputFolder
from ffseg.errors import ImageReadError, UsageError
from ffseg.image.polygons import polygons
from ffseg.io.exports import AnnotatedImage, json_text, labelme_document
from ffseg.io.files import (
    SKIP_FILE,
    is_temporary,
    make_folder,
    printable,
    read_bytes,
    remove_files,
    unwritten,
    write_all_atomic,
    write_bytes_atomic,
)
from ffseg.io.films import is_film
from ffseg.io.masks import decode_mask, encode_mask
from ffseg.io.starts import Start, starts_table
from ffseg.metrics import INSIDE
from ffseg.parameter_text import as_settings, non_defaults, yaml_lines
from ffseg.parameters import Parameters
from ffseg.picking.open_image import PickedRegion
from ffseg.picking.picks import History, ImagePicks, Journal

JOURNAL, STARTS, SETTINGS, MODEL, COMMAND = "picks.jsonl", "starts.csv", "pick.yaml", "model.ffmodel", "run.sh"
LEARNED, KEPT = "learned.json", "kept.json"
MASKS, LABELS, IMPORTED, REGIONS, RUN = "masks", "labels", "imported", "regions", "run"
MAX_BYTES = 1 << 28


class Project:
    """A folder with what is picked of one class.

    Parameters
    ----------
    folder : str
        Made if absent.
    sources : sequence of Source
        The images, by place.
    inputs : sequence of str
        What names them on a command line.
    params : Parameters
        For all images, without a model.
    review : str
        Output folder of a run whose masks are the regions as long as nothing is picked; or empty.
    label : str
        Name of the class, or empty.

    Raises
    ------
    OutputError
        If a file in it cannot be read or written.
    UsageError
        If it holds masks that were not picked.
    """

    def __init__(
        self,
        folder: str,
        sources: Sequence[InputImage],
        inputs: Sequence[str],
        params: Parameters,
        *,
        review: str = "",
        label: str = "",
    ) -> None:
        self.folder, self.sources, self.inputs, self.label = folder, sources, inputs, label
        self._params, self.review = params, review
        self._run: OutputFolder | None = None
        make_folder(os.path.join(folder, MASKS))
        self.journal = Journal(self.path(JOURNAL))
        try:
            self._require_own()
        except UsageError:
            self.journal.close()
            raise
        for name, inner, files in os.walk(folder):  # of a session that was killed
            inner[:] = [one for one in inner if one != RUN]  # where a run may be writing
            remove_files([os.path.join(name, one) for one in files if is_temporary(one)])
        write_bytes_atomic(os.path.join(folder, SKIP_FILE), b"outputs of ffseg pick\n")
        self._outdated = [name for name in self.journal.names(lambda track: track.accepted) if not self._stands(name)]

    def _require_own(self) -> None:
        """Refuse masks that were not picked: they would be learned from and replaced."""
        for source in self.sources:
            found = next((path for path in self._written(source.name) if os.path.lexists(path)), None)
            if found is not None and not self.journal.track(source.name).accepted:
                raise UsageError(
                    f"{printable(found)} was not picked here, and would be replaced; name another folder with --out DIR "
                    "(and this one with --review, to go on from its masks)"
                )

    def path(self, name: str) -> str:
        """A file of this folder."""
        return os.path.join(self.folder, name)

    def mask_path(self, name: str, folder: str = "") -> str:
        """The mask of an image of this relative name."""
        return os.path.join(folder or self.path(MASKS), f"{os.path.splitext(name)[0]}.png")

    def track(self, index: int) -> History:
        """The steps in an image."""
        return self.journal.track(self.sources[index].name)

    @property
    def model(self) -> str:
        """Path of the model that is used, or empty."""
        path = self.path(MODEL)
        return path if os.path.isfile(path) else ""

    @property
    def params(self) -> Parameters:
        """For all images, with the model where there is one."""
        model = self.model
        return replace(self._params, edges=replace(self._params.edges, model=model)) if model else self._params

    def base(self, name: str) -> Mask | None:
        """What another program or a run has found in an image; None where there is no mask of it."""
        imported = self.mask(name, IMPORTED)
        return self._reviewed(name) if imported is None else imported

    def _reviewed(self, name: str) -> Mask | None:
        """The mask of an image in the run that is reviewed, also where it was packed."""
        if self._run is None or self._run.path != Path(self.review):
            self._run = OutputFolder(Path(self.review), "run", [], {})
        path = self._run.output(MASKS, printable(name)) if self.review else ""
        with contextlib.suppress(ImageReadError):
            return decode_mask(self._run.content(path, MAX_BYTES)) if path else None
        return None

    def mask(self, name: str, folder: str = MASKS) -> Mask | None:
        """The mask of an image in one of the own folders; None where there is none."""
        with contextlib.suppress(ImageReadError):
            return decode_mask(read_bytes(self.mask_path(name, self.path(folder)), MAX_BYTES))
        return None

    def take(self, source: InputImage, mask: bytes) -> None:
        """Take a mask that was drawn elsewhere as that of an image in which nothing was picked, and accept it."""
        path = self.mask_path(source.name, self.path(IMPORTED))
        make_folder(os.path.dirname(path))
        write_bytes_atomic(path, mask)
        self.journal.add(source.name, "pick", ImagePicks(status="accepted"), size_of(source.path))

    def count(self, status: str) -> int:
        """Images of a status other than ``open``."""
        return len(self.journal.names(lambda track: track.now.status == status))

    def shows_many(self) -> bool:
        """Whether the mask of an accepted image shows many things, as `ffseg learn` takes it."""
        from ffseg.learning.examples import MIN_APART, share_apart  # loads forests, which no page waits for

        names = self.journal.names(lambda track: track.now.status == "accepted")
        masks = [mask for name in names if (mask := self.mask(name)) is not None]
        return any(share_apart(mask * np.uint8(INSIDE)) >= MIN_APART for mask in masks)

    def keep_region(self, region: Mask) -> str:
        """Keep what an accepted mask was painted on, whatever another model or run finds then; its digest."""
        data = encode_mask(region)
        digest = blake2b(data, digest_size=16).hexdigest()
        self.journal.require_in_place()
        make_folder(self.path(REGIONS))
        write_bytes_atomic(self.mask_path(digest, self.path(REGIONS)), data)
        return digest

    def keep(self, source: InputImage, found: PickedRegion | None, picture: bytes = b"") -> None:
        """Bring the files up to what the journal says, all or none.

        Parameters
        ----------
        found : PickedRegion or None
            The region of an accepted image.
        picture : bytes
            Its picture, for LabelMe, where it has no file of its own.

        Raises
        ------
        OutputError
            If one cannot be written.
        """
        mask, labels = self._written(source.name)
        files = []
        if found is not None:
            files = [(mask, encode_mask(found.mask)), (labels, self._labelme(source, found, labels, picture))]
            for path, _ in files:
                make_folder(os.path.dirname(path))
        step = json.dumps([source.name, self.journal.track(source.name).version]).encode("ascii")
        write_all_atomic([*files, *self._following(), (self.path(KEPT), step)])
        if found is None and self.journal.track(source.name).accepted:  # its own, of an image accepted no longer
            for path in (mask, labels):
                try:
                    os.unlink(path)
                except FileNotFoundError:
                    continue
                except OSError as error:
                    raise unwritten(path, error) from error

    def _written(self, name: str) -> tuple[str, str]:
        """The mask of an accepted image and its file for LabelMe."""
        return self.mask_path(name), f"{self.mask_path(name, self.path(LABELS))[:-4]}.json"

    def _labelme(self, source: InputImage, found: PickedRegion, path: str, picture: bytes) -> bytes:
        (height, width), place = found.mask.shape, path_from(path, source.display_path)
        regions, shown = polygons(found.mask, found.contours), b64encode(picture).decode("ascii")
        image = AnnotatedImage(place, width, height, regions, self.label or "region", shown)
        return json_text(labelme_document(image)).encode("ascii")

    def write_starts(self) -> None:
        """Write the starts file, the settings and the command anew."""
        write_all_atomic(self._following())

    def _following(self) -> list[tuple[str, bytes]]:
        return [
            (self.path(STARTS), starts_table(self._starts())),
            (self.path(SETTINGS), self._settings().encode()),
            (self.path(COMMAND), f"#!/bin/sh\n{self.command()}\n".encode(errors="surrogateescape")),
        ]

    def _starts(self) -> dict[str, Start]:
        """What was picked in these images, by their names."""
        ours = {one.name for one in self.sources}
        found = {name: track.now.start for name, track in self.journal.tracks.items() if name in ours}
        model = self.params.edges.model is not None
        return {name: replace(one, found=model and bool(one.circles)) for name, one in found.items() if one is not None}

    def outdated(self) -> list[str]:
        """Accepted images whose mask a crash or an error has kept from being written, or from being removed; told once."""
        names, self._outdated = self._outdated, []
        return names

    def _stands(self, name: str) -> bool:
        """Whether there is a mask of an image just where it is accepted, and written after the last step of all."""
        accepted = self.journal.track(name).now.status == "accepted"
        path = self.mask_path(name)
        if not accepted or name != self.journal.last or not os.path.isfile(path):
            return os.path.isfile(path) == accepted
        try:
            return bool(json.loads(read_bytes(self.path(KEPT), MAX_BYTES)) == [name, self.journal.track(name).version])
        except (ImageReadError, ValueError):  # of a version that wrote none
            return True

    def arguments(self) -> list[str]:
        """Arguments of the ``ffseg run`` that does all images, wherever it is called; of a film, what was picked is followed."""
        out, settings, table = (os.path.abspath(self.path(name)) for name in (RUN, SETTINGS, STARTS))
        starts = ["--starts", table] if self._starts() else []
        films = all(is_film(one.name) for one in self.sources)
        steady = ["--steady"] if films and starts and self.params.edges.model is None else []
        return ["run", *self.inputs, "--out", out, "--config", settings, *starts, *steady, "--overwrite"]

    def learning(self, out: str) -> list[str]:
        """Arguments of the ``ffseg learn`` from the masks there are: images are read as the run reads them."""
        settings = [word for one in as_settings(self._params) for word in ("--set", one)]
        return ["learn", *self.inputs, "--truth", self.path(MASKS), "--out", out, *settings, "--json", "--quiet"]

    def learned_from(self) -> list[object]:
        """All that a model follows from, as JSON gives it back: arguments, and each accepted image with its steps so far."""
        accepted = sorted(self.journal.names(lambda track: track.now.status == "accepted"))
        return [self.learning(""), [[name, self.journal.track(name).version] for name in accepted]]

    def command(self) -> str:
        """The ``ffseg run`` of all images as a line for a shell."""
        return shlex.join(["ffseg", *self.arguments()])

    def _settings(self) -> str:
        """A parameter file with what differs from the defaults."""
        head = "# Written by ffseg pick: what all images are segmented with."
        return "\n".join([head, *yaml_lines(non_defaults(self.params)), ""])


def size_of(path: str) -> int | None:
    """Bytes of a file; None of an address, or where it has gone."""
    with contextlib.suppress(OSError):
        return os.stat(path).st_size
    return None
