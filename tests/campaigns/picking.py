"""How quickly the page of `ffseg pick` follows, in Chromium; run ``python -m tests.campaigns.picking --work DIR``.

A drawn photograph of 800x600 and one of 12 megapixels: the mouse moves without a button, drags a box, drags a level; and of drawn
nuclei as many pixels: it moves where all things alike are meant. Printed for each, in ms, median and nine tenths: ``all``, from
the mouse's move to the frame with the contour; of these ``waited``, until the page could ask; ``asked``, until it had the answer;
``server``, what that took the server; ``find``, the segmentation alone; the rest is the browser's drawing. Beside them, for each
contour, the processor's time of the server and of all of the browser's processes, which other work on the machine does not
lengthen so much.
"""

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import chromium
import cv2
import numpy as np
from numpy.typing import NDArray
from pick_page import SETTLED, Hand

from ffseg.learning.drawn.sights import sights
from ffseg.parameter_files import load_params
from ffseg.picking.server import Server
from ffseg.picking.session import Session
from tests.campaigns import harness
from tests.campaigns.all_things import nuclei
from tests.campaigns.harness import Work, children, say
from tests.many_things import deepest

SIZES = ((800, 600), (4000, 3000))
MOVES, APART_S = 60, 0.03
"""Moves of the mouse of one kind, and the time between two."""
NOISE = 2.0
"""Grey levels of grain, so that an enlarged drawing is none."""
STAGES = ("all", "waited", "asked", "server", "find")
TICK_MS = 1e3 / os.sysconf("SC_CLK_TCK")


def draw(path: Path, image: NDArray[np.uint8], size: tuple[int, int]) -> None:
    image = np.atleast_3d(cv2.resize(image, size, interpolation=cv2.INTER_CUBIC))
    grain = np.random.default_rng(0).normal(0, NOISE, (*image.shape[:2], 1))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(cv2.imencode(".jpg", np.clip(image + grain, 0, 255).astype(np.uint8))[1].tobytes())


def browser_ms(pid: int) -> float:
    """Processor time of a browser's processes so far."""
    try:
        own = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(own[11]) + int(own[12])) * TICK_MS + sum(map(browser_ms, children(pid)))


class Watched:
    """A hand that moves, and what each contour takes meanwhile."""

    def __init__(self, tab: chromium.Chromium, session: Session, hand: Hand) -> None:
        self.tab, self.hand, self.server_ms, self._find = tab, hand, 0.0, session.find
        session.find = self.find  # type: ignore[method-assign]

    def find(self, *words: Any, **more: Any) -> Any:
        """As the session's, timed on the processor."""
        begin = time.thread_time()
        found = self._find(*words, **more)
        self.server_ms += (time.thread_time() - begin) * 1e3 * more["quick"]
        return found

    def moves(self, name: str, move: Callable[[float], None]) -> None:
        """Move from share 0 to 1 and print what the contours on the way took."""
        self.tab.until(SETTLED)
        self.tab.value("ffsegTimes.length = 0")
        pid = self.tab._process.pid
        begin, self.server_ms = browser_ms(pid), 0.0
        for step in range(MOVES):
            move((step + 1) / MOVES)
            time.sleep(APART_S)
        self.tab.until(SETTLED)
        took = [one for one in self.tab.value("ffsegTimes") if one["quick"]]
        browser = (browser_ms(pid) - begin) / len(took)
        cells = [sorted(one[stage] for one in took) for stage in STAGES]
        said = ", ".join(
            f"{stage} {median(cell):.0f} {cell[int(0.9 * len(cell))]:.0f}"
            for stage, cell in zip(STAGES, cells, strict=True)
        )
        say(
            f"{name}: {len(took)} contours; {said}; processor: server {self.server_ms / len(took):.0f}, browser {browser:.0f}"
        )


def between(one: tuple[float, float], other: tuple[float, float], share: float) -> tuple[float, float]:
    return one[0] * (1 - share) + other[0] * share, one[1] * (1 - share) + other[1] * share


def follow(tab: chromium.Chromium, work: Path, size: tuple[int, int]) -> None:
    """How the contour follows in an image of a size."""
    folder = work / f"{size[0]}x{size[1]}"
    draw(folder / "photos" / "a.jpg", next(sights("street", 1, 5_002)).image, size)
    cells, truth = nuclei(0)
    draw(folder / "photos" / "b.jpg", cells, size)
    with Session([str(folder / "photos")], str(folder / "picked"), load_params()) as session, Server(session) as server:
        server.begin()
        hand = Hand(tab, server.address)
        watched, (width, height) = Watched(tab, session, hand), size
        start, corner = hand.at(0.5 * width, 0.8 * height), hand.at(0.1 * width, 0.4 * height)
        far = hand.at(0.9 * width, 0.9 * height)
        say(f"{width}x{height}")
        watched.moves("hover", lambda share: tab.hover(start[0] * share + corner[0] * (1 - share), start[1]))
        tab.mouse("mousePressed", *corner, "left")
        watched.moves("box", lambda share: tab.mouse("mouseMoved", *between(corner, far, share), "left"))
        tab.mouse("mouseReleased", *far, "left")
        tab.press("x")
        tab.until("document.querySelectorAll('#marks *').length === 0")
        tab.click(*start)
        tab.until("document.querySelectorAll('#marks circle').length === 1")
        tab.mouse("mousePressed", *start, "left")
        watched.moves("level", lambda s: tab.mouse("mouseMoved", start[0], start[1] - 10 - 60 * s, "left"))
        tab.mouse("mouseReleased", start[0], start[1] - 70, "left")
        tab.press("n")
        tab.until("document.getElementById('name').textContent === 'b.jpg'")
        column, row = deepest(truth)
        tab.click(*hand.at(column * width / truth.shape[1], row * height / truth.shape[0]))
        tab.until("document.querySelectorAll('#marks circle').length === 1")
        tab.press("k")
        tab.until("document.getElementById('alike').getAttribute('aria-pressed') === 'true'")
        watched.moves("alike", lambda share: tab.hover(start[0] * share + corner[0] * (1 - share), corner[1]))
        server.shutdown()


def main(work: Work) -> int:
    """See the module."""
    program = chromium.find()
    if program is None:
        sys.exit("no Chromium on the search path; install it, or name one in the environment variable FFSEG_CHROMIUM")
    with chromium.Chromium(program, work / "profile") as tab:
        for size in SIZES:
            follow(tab, work, size)
    return 0


if __name__ == "__main__":
    harness.as_command(main)
