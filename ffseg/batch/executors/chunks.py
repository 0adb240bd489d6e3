"""Progress files of chunks, which survive the machine that works on them: a line for each finished image.

A machine that dies costs the images of its chunk that have no line; a run that dies finds the lines when it is resumed.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path
from typing import Any

from ffseg.batch.values import json_line, parsed_line
from ffseg.batch.workers.messages import Digests, Done, Encoded, Failed, Reply
from ffseg.io.files import make_folder, remove_files

CHUNKS = "chunks"
_RUNNING = ".going"


@dataclass(frozen=True, slots=True)
class Chunks:
    """Files of the chunks of one run."""

    folder: str
    run: str
    """Different for every run."""

    @classmethod
    def begin(cls, state: str) -> Chunks:
        """Make the folder below a state folder; chunks of earlier runs that are still worked on stop."""
        folder = os.path.join(state, CHUNKS)
        make_folder(folder)
        chunks = cls(folder, os.urandom(6).hex())
        remove_files(os.path.join(folder, name) for name in os.listdir(folder) if name.endswith(_RUNNING))
        Path(chunks.going).touch()
        return chunks

    @property
    def going(self) -> str:
        """File that is there as long as the run wants its chunks done."""
        return os.path.join(self.folder, self.run + _RUNNING)

    def path(self, number: int) -> str:
        """File of a chunk."""
        return os.path.join(self.folder, f"{self.run}-{number}.jsonl")

    def end(self) -> None:
        """Let whoever still works on a chunk stop."""
        remove_files([self.going])


def reply_line(name: str, settings: str, reply: Reply) -> bytes:
    """A reply as a line; the outputs are written already."""
    return json_line({"name": name, "settings": settings, "kind": type(reply).__name__, "reply": asdict(reply)})


def replies(path: str, settings: str) -> Iterator[tuple[str, Reply]]:
    """Names and replies of the lines of a chunk's file that were made with these parameters."""
    if not os.path.isfile(path):
        return
    with Path(path).open("rb") as file:
        for line in file:
            value = parsed_line(line)
            if value is not None and value.get("settings") == settings:
                with contextlib.suppress(TypeError, ValueError, KeyError, AttributeError):
                    yield str(value["name"]), _reply(value["kind"], value["reply"])


def _reply(kind: str, parts: Mapping[str, Any]) -> Reply:
    if kind == "Failed":
        return Failed(**parts)
    digests = parts["digests"]
    files = {
        role: (path, digest, (int(mark[0]), int(mark[1]))) for role, (path, digest, mark) in digests["files"].items()
    }
    outputs = tuple(Encoded(**one) for one in parts["outputs"])
    return Done(**{**parts, "digests": Digests(**{**digests, "files": files}), "outputs": outputs})


def left_over(state: str, settings: str) -> Iterator[tuple[str, Reply]]:
    """Names and replies of the chunks whose files are there: that no run has lived to write down."""
    return chain.from_iterable(replies(path, settings) for path in _files(state))


def remove_chunks(state: str) -> None:
    """Remove the files of all chunks."""
    remove_files(_files(state))


def _files(state: str) -> list[str]:
    folder = os.path.join(state, CHUNKS)
    names = os.listdir(folder) if os.path.isdir(folder) else ()
    return sorted(os.path.join(folder, name) for name in names if name.endswith(".jsonl"))
