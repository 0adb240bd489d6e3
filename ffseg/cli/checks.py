"""Checks before a command does anything: empty folder names, invalid numbers, missing masks."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from ffseg.parameters import Parameters

MAX_SECONDS = 10_000_000.0
"""Longer limits are none: 115 days."""
MAX_MEGABYTES = 100_000_000
"""More memory than a machine has, and far from what the system's counters hold."""


def folder(text: str) -> Path:
    """Read the name of a folder: not of a file, nor ``-``; of ``--out=~/x`` the shell leaves the tilde to us."""
    if text == "-":
        raise typer.BadParameter("- is no folder; write ./- if it is called so")
    if "://" in text:
        raise typer.BadParameter(
            f"{text} is an address; outputs go into a folder of this machine: copy them there then"
        )
    path = Path(text).expanduser() if text == "~" or text.startswith("~/") else Path(text)
    if os.path.exists(path) and not os.path.isdir(path):  # Path's own raise where a name is too long or not to be seen
        raise typer.BadParameter(f"{text} is a file; name a folder")
    return path


def folder_or_stdout(text: str) -> Path:
    """Read the name of a folder, or ``-``."""
    return Path(text) if text == "-" else folder(text)


def number(value: float) -> float:
    """Refuse ``nan``, which passes every comparison with a limit."""
    if value != value:
        raise typer.BadParameter("nan is not a number")
    return value


def output_file(option: str, path: Path, kind: str = "") -> None:
    """Refuse, before the work, a file that could not be written after it, or that is no earlier one of its kind."""
    from ffseg.errors import OutputError, UsageError
    from ffseg.io.files import printable, require_replaceable

    folder = path.parent
    if not os.path.isdir(folder):
        raise UsageError(f"{option}: there is no folder {printable(folder)}; make it or choose another name")
    if not (_may_be_a_file(path) and os.access(folder, os.W_OK | os.X_OK)):
        raise UsageError(f"{option}: {printable(path)} cannot be written; choose another name")
    try:
        require_replaceable(os.fspath(path))
    except OutputError as error:
        raise UsageError(f"{option}: {error}") from error
    if kind:
        refuse_others([(os.fspath(path), kind)], f"choose another name for {option}")


def _may_be_a_file(path: Path) -> bool:
    try:
        return not stat.S_ISDIR(path.stat().st_mode)
    except OSError as error:
        return error.errno == errno.ENOENT


def refuse_others(targets: Iterable[tuple[str, str]], remedy: str) -> None:
    """Refuse to replace files, given with their kinds, that are not known as what an earlier call wrote."""
    from ffseg.errors import UsageError
    from ffseg.io.files import printable
    from ffseg.io.saving import is_own

    for path, kind in targets:
        if os.path.isfile(path) and not is_own(path, kind):
            raise UsageError(f"{printable(path)} is there already and not known as a file of ffseg; {remedy}")


def require_truth(truth: Path | None, label: int | None) -> None:
    """Refuse a class number without masks that it could be in."""
    from ffseg.errors import UsageError

    if label is not None and truth is None:
        raise UsageError("--truth-label is the class of true masks; add --truth DIR")


def checked_params(
    config: str | None, settings: Sequence[str] | None = None, *, allow_code: bool = False
) -> Parameters:
    """Load a parameter set of a command, and see that the files and plug-ins it names are there."""
    from ffseg.errors import ParameterError
    from ffseg.io.files import printable
    from ffseg.parameter_files import load_params
    from ffseg.parameters import ZERO_BALLOON

    params = load_params(config, settings, allow_code=allow_code)
    plugin_files(params)
    masks = {
        "domain.mask": params.domain.mask,
        "init.mask": params.init.mask,
        "init.background_mask": params.init.background_mask,
        "edges.model": params.edges.model,
    }
    missing = [
        f"{printable(config) + ': ' if config else ''}{key}: {_complaint(key, path)}"
        for key, path in masks.items()
        if path is not None and not os.path.isfile(path)
    ]
    if params.domain.mask is not None and params.domain.masks is not None:
        missing.append("domain.mask and domain.masks do not go together; leave out one of them")
    others = [key for key in ("boxes", "circles") if params.init.mask is not None and getattr(params.init, key)]
    missing += [f"init.mask and init.{key} do not go together; leave out one of them" for key in others]
    if params.method == "freeform" and params.contour.balloon == 0:
        missing.append(f"{printable(config) + ': ' if config else ''}{ZERO_BALLOON}")
    if missing:
        raise ParameterError("\n".join(missing))
    if params.edges.model is not None:
        from ffseg.evidence.source import check_model

        check_model(params.edges.model, params.network)
    return params


def plugin_files(params: Parameters) -> dict[str, str]:
    """Files of the plug-ins that a parameter set names, by their keys: with another content results are others."""
    from ffseg.errors import ParameterError
    from ffseg.plugins import check, method

    row = method(params.method)
    if not row.installed:
        raise ParameterError(f"method: {params.method} needs the package {row.package}; install it, or ffseg[peers]")
    named = (("methods", params.method), ("evidence", params.edges.source))
    files = {f"{kind} {name}": check(kind, name) for kind, name in named}
    return {name: path for name, path in files.items() if path}


def ready_params(
    config: str | None, settings: Sequence[str] | None, evidence: Path | None = None, *, allow_code: bool = False
) -> Parameters:
    """Load the parameter set of a command that segments: its edge source has its model, or maps that are named."""
    from ffseg.plugins import check_source

    params = checked_params(config, settings, allow_code=allow_code)
    if evidence is None:
        check_source(params.edges.source, params.edges.model, alike=params.region.islands == "all")
    return params


def _complaint(key: str, path: str) -> str:
    from ffseg.io.files import printable

    if os.path.lexists(path):
        what = "a model; name a .ffmodel or .onnx file" if key == "edges.model" else "an image; name a PNG, TIFF, ..."
        return f"{printable(path)} is not a file that can be read as {what}"
    return f"there is no file {printable(path)}; names in a parameter file are relative to that file"
