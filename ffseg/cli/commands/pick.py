"""``ffseg pick``: click what is inside, in a browser, and let it learn."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ffseg.cli import console
from ffseg.cli.checks import folder, ready_params
from ffseg.cli.options import Config, Settings
from ffseg.errors import ParameterError, UsageError
from ffseg.io.files import printable

if TYPE_CHECKING:
    from ffseg.parameters import Parameters
    from ffseg.picking.session import Session


def pick(  # noqa: PLR0913 - the options of the command
    inputs: Annotated[
        list[str] | None, typer.Argument(metavar="INPUT...", help="Image files, folders (any depth) or patterns.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", parser=folder, help="Folder for what is picked; without it INPUT-picked."),
    ] = None,
    labels: Annotated[str | None, typer.Option(metavar="A,B", help="Names of classes, each picked by itself.")] = None,
    review: Annotated[
        Path | None,
        typer.Option(metavar="DIR", parser=folder, help="Output folder of run: accept or correct its masks."),
    ] = None,
    labels_from: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Regions of LabelMe, COCO or VIA (or folder of LabelMe's)."),
    ] = None,
    config: Config = None,
    settings: Settings = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Of the page; 0 = any that is free.")] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page.")] = True,
) -> None:
    """Pick regions in a browser with clicks, boxes and a brush; saved as they are made.

    Serves a page to this machine only, until Ctrl-C. Under DIR: starts.csv, masks of what was accepted, pick.yaml, a
    model learned from the masks while you pick, and run.sh, which does all images.
    """
    from ffseg.picking.session import Session, inputs_of

    params = _params(review, config, settings or ())
    if review is not None and not inputs:
        inputs = inputs_of(review)
    if not inputs:
        raise UsageError("there is no input; name image files, folders or patterns")
    target = os.fspath(out) if out is not None else f"{os.path.abspath(review or inputs[0]).rstrip('/')}-picked"
    if out is None and (len(inputs) > 1 or not os.path.isdir(inputs[0])) and review is None:
        raise UsageError(
            "name the folder for what is picked with --out DIR; it has a name of its own for one folder only"
        )
    from ffseg.io.labels import read_labels
    from ffseg.io.tables import counted
    from ffseg.learning.gather import some_names

    drawn = None if labels_from is None else read_labels(labels_from)
    chosen = [one.strip() for one in labels.split(",")] if labels is not None else []
    with Session(inputs, target, params, chosen, os.fspath(review) if review else "") as session:
        if drawn is not None:
            taken, odd = session.take(drawn)
            console.message(f"ffseg: {counted(taken, 'mask')} taken from {printable(os.fspath(labels_from or ''))}")
            if odd:
                console.message(
                    f"ffseg: a region holds no pixel, or all of them, in {some_names([*map(printable, odd)])}"
                )
            unknown = sorted(drawn.classes() - set(chosen)) if chosen else []
            if unknown:
                console.message(f"ffseg: left out, as no class of --labels: {some_names([*map(printable, unknown)])}")
            others = drawn.without([source.name for source in session.sources])
            if others:
                console.message(
                    f"ffseg: left out, as no image or several could be meant: {some_names([*map(printable, others)])}"
                )
        changed = session.changed()
        if changed:
            names = some_names([*map(printable, changed)])
            console.message(f"ffseg: changed since they were picked in, look at them and accept them again: {names}")
        _serve(session, port, browser)


def _params(review: Path | None, config: str | None, settings: Sequence[str]) -> Parameters:
    """What is asked for; of a run that is reviewed what it was made with, where no file says others."""
    from ffseg.picking.session import settings_of

    if review is None or config is not None:
        return ready_params(config, settings)
    own = settings_of(review)
    try:
        ready_params(None, own)
    except ParameterError as error:
        name = printable(os.fspath(review))
        raise ParameterError(f"{name}: {error}; name what the run was made with in --config FILE") from error
    return ready_params(None, [*own, *settings])


def _serve(session: Session, port: int, browser: bool) -> None:
    from ffseg.io.tables import counted
    from ffseg.picking.server import Server

    ended = threading.Event()
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda *_: ended.set())
    try:
        server = Server(session, port)
    except OSError as error:
        raise UsageError(f"--port {port} cannot be used ({os.strerror(error.errno or 0)}); choose another") from error
    with server:
        server.begin()
        console.data(server.address)
        console.message(
            f"ffseg: {counted(len(session.sources), 'image')}; saved in {printable(session.out)}; the address is for you "
            "alone, Ctrl-C ends it"
        )
        if browser:
            import webbrowser

            webbrowser.open(server.address)
        while not ended.wait(0.5):
            pass
        server.shutdown()
        if server.busy:
            console.message("ffseg: ends as soon as a region that is being found is there")
    console.message(f"ffseg: all of it is in {printable(session.out)}; the same command goes on from there")
