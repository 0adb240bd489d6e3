"""Inputs of a run: files, folders in natural order, patterns and lists, as one list without duplicates."""

from __future__ import annotations

import glob
import os
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from ffseg.batch.outputs.table import OUTPUT_FOLDERS
from ffseg.batch.plan.archives import images_among, is_archive, members
from ffseg.batch.plan.remote import PROTOCOLS, file_system, is_remote, remote_name, small_scheme
from ffseg.batch.plan.sources import READ_SUFFIXES, STATE_FOLDER, SUFFIXES, InputImage, natural_key
from ffseg.errors import ImageReadError, UsageError
from ffseg.io.bags import MARK, stamps
from ffseg.io.files import SKIP_FILE, is_temporary, printable
from ffseg.io.films import ANIMATIONS, film_contents, is_film, require_video

_CHECK = "check the name"
_ADDRESSES = ", ".join(f"{one}://" for one in PROTOCOLS if one != "memory")


def discover(
    inputs: Sequence[str | InputImage], *, film: bool = False, skipped: Counter[str] | None = None
) -> list[InputImage]:
    """Images named by files, folders and patterns, each once; of a film its frames.

    Parameters
    ----------
    inputs : sequence of str or InputImage
        Each an image that was found before, a file, a folder (walked recursively, natural order), or a pattern
        with ``*``, ``?``, ``[...]`` or ``**``.
    film : bool
        Take every frame of animations and every page of stacks, not only the first.
    skipped : Counter, optional
        Counts files of folders by suffix that are taken for no images.

    Raises
    ------
    UsageError
        If an input does not exist, or holds no image, or films cannot be read here.
    """
    found: dict[tuple[str, str], InputImage] = {}
    skipped = Counter() if skipped is None else skipped
    for place, entry in enumerate(inputs):
        files = _expand(entry, skipped) if isinstance(entry, str) else [entry]
        sources = [frame for source in files for frame in frames(source, film=film)]
        if not sources:
            films = "; name a film by its file" if any(map(is_film, skipped)) else ""
            raise UsageError(
                f"{printable(str(entry))} holds no image; hidden files, outputs of ffseg and folders below with a file "
                f"{SKIP_FILE} are left out, and images in a folder need one of the suffixes {READ_SUFFIXES}{films}"
            )
        places: dict[str, str] = {}  # of archives: their members need not ask the disk each
        for source in sources:
            real = places.get(source.path)
            real = real or (source.path if "://" in source.path else os.path.realpath(source.path))
            if source.span is not None:
                places[source.path] = real
            found.setdefault((real, source.name), replace(source, place=place))
    return list(found.values())


def frames(source: InputImage, *, film: bool = False) -> list[InputImage]:
    """The frames of a film, called ``film_000123.mp4``; what is none alone, and what cannot be read with its problem.

    Parameters
    ----------
    film : bool
        Whether animations and stacks of pages are films.
    """
    by_frames = is_film(source.path) or (film and source.path.lower().endswith(ANIMATIONS))
    if not by_frames or source.problem or source.span is not None or is_remote(source.path):
        return [source]
    require_video(source.path)
    try:
        found = film_contents(source.path)
    except ImageReadError as error:
        return [replace(source, problem=f"{error.reason}: {error}")]
    if len(found.times) == 1 and not is_film(source.path):
        return [source]
    stem, end = os.path.splitext(source.name)
    listed = [
        replace(source, name=f"{stem}_{number:06d}{end}", span=(number, 1), time=time)
        for number, time in enumerate(found.times)
    ]
    missing = replace(source, name=f"{stem}_{len(listed):06d}{end}", span=(len(listed), 1), problem=found.problem)
    return [*listed, missing] if found.problem else listed


def bag_frames(bag: str, topic: str) -> list[InputImage]:
    """The images of a topic of a bag, called ``camera_image_000123.png``, with their seconds since the first."""
    if not (bag and topic):
        raise UsageError("--bag and --topic go together; name the bag and the topic of its images")
    path = f"{bag}{MARK}{topic.lstrip('/')}"
    times = stamps(path)
    if not times:
        raise UsageError(f"{printable(bag)} has no image on {printable(topic)}; name another topic")
    stem = topic.strip("/").replace("/", "_")
    return [
        InputImage(path, f"{stem}_{number:06d}.png", span=(number, 1), time=round((at - times[0]) / 1e9, 6), stamp=at)
        for number, at in enumerate(times)
    ]


def _expand(text: str, skipped: Counter[str]) -> list[InputImage]:
    if is_remote(text):
        return _remote_sources(small_scheme(text))
    if os.path.isdir(text):
        return sorted(_walk(text, skipped), key=_source_key)
    if is_archive(text) and os.path.isfile(text):
        return sorted(members(text), key=_source_key)
    if os.path.lexists(text):
        return [InputImage(text, os.path.basename(text))]
    if not glob.has_magic(text):
        remedy = _CHECK
        if text == "-":
            remedy = "'ffseg segment - OUT' takes an image on stdin, 'ffseg run - --out -' frames"
        elif "://" in text:
            remedy = f"addresses begin with one of {_ADDRESSES}; name what is on this machine by its path"
        raise UsageError(f"there is no file or folder {printable(text)}; {remedy}")
    return _expand_pattern(text, skipped)


def _remote_sources(url: str) -> list[InputImage]:
    """Images of a URL: one, those of a pattern, or those below a folder of a store."""
    try:
        if url.startswith("http"):
            return [InputImage(url, remote_name(url))]
        system, path = file_system(url)
        if any(mark in path for mark in "*?[") and not system.isfile(path):
            base = path[: min(path.find(mark) for mark in "*?[" if mark in path)].rpartition("/")[0]
            paths = [one for one in system.glob(path) if not system.isdir(one)]
        elif not system.isdir(path):
            return [InputImage(url, remote_name(path))]
        else:
            base, paths = path.rstrip("/"), system.find(path)
    except Exception as error:  # every store raises its own kinds
        raise UsageError(f"{printable(url)} cannot be listed ({type(error).__name__}: {error})"[:500]) from error
    named = {one[len(base) :].lstrip("/"): one for one in paths}
    images = sorted(images_among(named, SUFFIXES), key=natural_key)
    return [InputImage(system.unstrip_protocol(named[name]), name) for name in images]


def _expand_pattern(pattern: str, skipped: Counter[str]) -> list[InputImage]:
    base = fixed_folder(pattern)
    if ".." in pattern[len(base) :].split("/"):  # the name of an output would lead out of the output folder
        raise UsageError(f"the pattern {printable(pattern)} has '..' behind a wildcard; write the folder it leads to")
    matches = sorted(glob.iglob(pattern, recursive=True), key=lambda path: natural_key(_relative(path, base)))
    if not matches:
        raise UsageError(f"the pattern {printable(pattern)} matches no file; check the folder it starts in")
    sources: list[InputImage] = []
    for match in matches:
        if os.path.isdir(match):
            if "**" not in pattern:  # '**' names the files below as well
                below = sorted(_walk(match, skipped), key=_source_key)
                sources += [InputImage(found.path, _relative(found.path, base), found.problem) for found in below]
        elif (is_film(match) or _is_image_name(os.path.basename(match))) and not _is_output(
            _relative(match, base), base
        ):
            sources.append(InputImage(match, _relative(match, base)))
    return sources


def fixed_folder(pattern: str) -> str:
    """Longest leading folder of a pattern without wildcards; empty for the current one."""
    parts = pattern.split("/")
    fixed = next(index for index, part in enumerate(parts) if glob.has_magic(part))
    return "/".join(parts[:fixed]) + ("/" if fixed else "")


def _relative(path: str, base: str) -> str:
    return os.path.relpath(path, base or ".").replace(os.sep, "/")


def _is_output(name: str, base: str) -> bool:
    """Whether a relative name leads through an output folder, told by the state folder beside it."""
    parts = name.split("/")
    return any(
        part in OUTPUT_FOLDERS and os.path.isdir(os.path.join(base, *parts[:index], STATE_FOLDER))
        for index, part in enumerate(parts[:-1])
    )


def _is_image_name(name: str) -> bool:
    if name.startswith(".") or is_temporary(name):
        return False
    return os.path.splitext(name)[1].lower() in SUFFIXES


def _source_key(source: InputImage) -> str:
    return natural_key(source.name)


def _walk(root: str, skipped: Counter[str]) -> Iterator[InputImage]:
    """Images below a folder; every real folder is entered once, first by its own name, then by links to it."""
    visited: set[tuple[int, int] | None] = set()
    folders, links = [(root, "")], list[tuple[str, str]]()
    while folders or links:
        folder, prefix = folders.pop() if folders else links.pop(0)
        entered = identity(folder)
        if entered in visited:
            continue
        visited.add(entered)
        entries = _entries(folder)
        if isinstance(entries, str):
            yield InputImage(folder, prefix.rstrip("/") or os.path.basename(folder), f"unreadable: {entries}")
            continue
        if prefix and any(entry.name == SKIP_FILE for entry in entries):
            continue
        outputs = OUTPUT_FOLDERS if any(entry.name == STATE_FOLDER for entry in entries) else ()
        for entry in entries:
            if entry.name.startswith(".") or entry.name in outputs:
                continue
            if _is_folder(entry):
                (links if entry.is_symlink() else folders).append((entry.path, f"{prefix}{entry.name}/"))
            elif _is_image_name(entry.name):
                yield InputImage(entry.path, prefix + entry.name)
            elif not (outputs or is_temporary(entry.name)):
                skipped[os.path.splitext(entry.name)[1].lower()] += 1


def _entries(folder: str) -> list[os.DirEntry[str]] | str:
    try:
        with os.scandir(folder) as entries:
            return sorted(entries, key=lambda entry: natural_key(entry.name))
    except OSError as error:
        return f"the folder cannot be listed ({os.strerror(error.errno or 0)}); check its permissions"


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:  # a link that leads back to itself
        return False


def identity(path: str) -> tuple[int, int] | None:
    """What a file or folder is, by whatever name; None where there is none."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_dev, status.st_ino


_MAX_LIST_BYTES = 1 << 32


def sources_of_list(path: str, *, nul: bool = False) -> list[InputImage]:
    """Sources of a list.

    Parameters
    ----------
    path : str
        File with one path a line; ``-`` for stdin.
    nul : bool
        Paths end with a NUL instead of a line end, as ``find -print0`` writes them.

    Returns
    -------
    list of Source
        In the order of the list. Paths that lead nowhere above the working folder keep their names; else all names are
        relative to the folder that all paths have in common.

    Raises
    ------
    UsageError
        If the list cannot be read, or names nothing.
    """
    end = b"\0" if nul else b"\n"
    paths = [os.fsdecode(line) for line in _list_content(path).split(end) if line.strip()]
    if any("\0" in one for one in paths):
        raise UsageError(
            f"--list: {printable(path)} holds NUL bytes, which no path does; add -0 if its paths end with them"
        )
    paths = [text if nul else text.rstrip("\r") for text in paths]
    if not paths:
        raise UsageError(f"--list: {printable(path)} names no image; write one path a line")
    names = _list_names(paths)
    sources = (InputImage(one, name, place=place) for place, (one, name) in enumerate(zip(paths, names, strict=True)))
    return list({(source.path, source.name): source for source in sources}.values())


def _list_content(path: str) -> bytes:
    try:
        if path == "-":
            return sys.stdin.buffer.read(_MAX_LIST_BYTES)
        with Path(path).open("rb") as file:
            return file.read(_MAX_LIST_BYTES)
    except OSError as error:
        reason = os.strerror(error.errno or 0)
        raise UsageError(f"--list: {printable(path)} cannot be read ({reason}); check the name") from error


def _list_names(paths: list[str]) -> list[str]:
    plain = [path.partition("://")[2] if is_remote(path) else os.path.normpath(path) for path in paths]
    if not any(os.path.isabs(path) or path.split("/")[0] == ".." for path in plain):
        return plain
    whole = [path if is_remote(text) else os.path.abspath(text) for path, text in zip(plain, paths, strict=True)]
    base = os.path.commonpath({os.path.dirname(path) or "." for path in whole})
    return [os.path.relpath(path, base).replace(os.sep, "/") for path in whole]
