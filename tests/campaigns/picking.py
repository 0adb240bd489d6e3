"""``python -m tests.campaigns.picking --out DIR``: a folder of drawn photographs picked by a simulated stranger in Chromium.

The stranger clicks where the largest error is deepest, at most so often an image, and accepts; what is proposed well is accepted
as it is. After some images the folder is run. Printed: clicks, what the model proposed, the IoU of all masks at the end, how the
contour followed the hand, and what a hand would have taken. ``--film FILE`` makes an animation of it. ``--many N`` opens a
folder of N images instead and says how long the page takes. The drawings are of kinds that the prior learned from, with seeds
of their own: they show the way, not how well it does on photographs.
"""

from __future__ import annotations

import argparse
import io
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import mean, median
from typing import Any

import cv2
import numpy as np
from PIL import Image, ImageDraw

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import chromium

from ffseg.learning.drawn.sights import sights
from ffseg.parameters import load_params
from ffseg.picking.server import Server
from ffseg.picking.session import Session

GOOD, MOST_CLICKS = 0.9, 5
"""IoU at which the stranger is content, and clicks after which one is."""
A_CLICK_S, A_LOOK_S = 2.0, 4.0
"""Seconds of a stranger's time: a click that is thought over, a look at a new image and its acceptance."""
FIRST_SEED = 5_000
"""Of the drawings: the forests that ship learned from seeds below."""
WINDOW, FILM_WIDTH = (1000, 800), 640
"""Pixels, of the browser and of the animation."""


def drawn(folder: Path, kind: str, count: int) -> list[np.ndarray]:
    """Write images; their truths, 255 inside, 128 doubtful."""
    folder.mkdir(parents=True)
    truths = []
    for number in range(count):
        sight = next(sights(kind, 1, FIRST_SEED + number))
        wide = (640, round(640 * sight.image.shape[0] / sight.image.shape[1]))
        image = cv2.resize(sight.image, wide, interpolation=cv2.INTER_CUBIC)
        truths.append(cv2.resize(sight.truth, wide, interpolation=cv2.INTER_NEAREST))
        (folder / f"{number:03d}.jpg").write_bytes(cv2.imencode(".jpg", image)[1].tobytes())
    return truths


def overlap(mask: np.ndarray, truth: np.ndarray) -> float:
    """IoU where the truth is sure."""
    inside, known = truth == 255, truth != 128
    return float((mask & inside & known).sum() / max(1, ((mask | inside) & known).sum()))


def deepest(mask: np.ndarray, truth: np.ndarray) -> tuple[float, float, bool]:
    """Where the next click goes, and whether it says inside: the point farthest from the rim of its error."""
    best, where = 0.0, (0.0, 0.0, True)
    for error, inside in (((truth == 255) & ~mask, True), ((truth == 0) & mask, False)):
        depth = cv2.distanceTransform(np.pad(error, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
        if depth.max() > best:
            best = float(depth.max())
            y, x = np.unravel_index(depth.argmax(), depth.shape)
            where = (float(x), float(y), inside)
    return where


class Stranger:
    """Someone at the page who knows what is wanted."""

    def __init__(self, tab: chromium.Chromium, server: Server, truths: Sequence[np.ndarray]) -> None:
        self.tab, self.server, self.truths = tab, server, truths
        self.clicks: list[int] = []
        self.proposed: list[float] = []
        self.frames: list[tuple[Image.Image, int]] = []
        self.filming = False

    def index(self) -> int:
        """The image that is shown."""
        return int(self.tab.value("location.hash.split('/')[1]"))

    def mask(self) -> np.ndarray:
        """What is found of what is picked in it."""
        session, index = self.server.session, self.index()
        return session._found(session.projects[0], index, session.projects[0].track(index).now).mask

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Of a pixel of the image, where it stands in the window."""
        left, top, width = self.tab.value(
            "(() => { const b = document.getElementById('picture').getBoundingClientRect(); return [b.x, b.y, b.width] })()"
        )
        scale = width / self.truths[self.index()].shape[1]
        return left + (x + 0.5) * scale, top + (y + 0.5) * scale

    def shown(self, ms: int, cursor: tuple[float, float] | None = None) -> None:
        """Take a picture for the animation."""
        if not self.filming:
            return
        path = Path(self.server.session.projects[0].path("shot.png"))
        self.tab.screenshot(path)
        frame = Image.open(io.BytesIO(path.read_bytes())).convert("RGB")
        path.unlink()
        if cursor:
            x, y = cursor
            pointer = [
                (x, y),
                (x, y + 22),
                (x + 5, y + 17),
                (x + 9, y + 25),
                (x + 13, y + 23),
                (x + 9, y + 15),
                (x + 16, y + 15),
            ]
            ImageDraw.Draw(frame).polygon(pointer, fill="white", outline="black")
        height = round(frame.height * FILM_WIDTH / frame.width)
        self.frames.append((frame.resize((FILM_WIDTH, height), Image.Resampling.LANCZOS), ms))

    def one_image(self) -> None:
        """Pick until content, accept."""
        self.tab.until("document.getElementById('picture').complete")
        truth, track = self.truths[self.index()], self.server.session.projects[0].track(self.index())
        mask, clicks = self.mask(), 0
        self.proposed.append(overlap(mask, truth))
        self.settle()
        self.shown(900)
        while overlap(mask, truth) < GOOD and clicks < MOST_CLICKS:
            x, y, inside = deepest(mask, truth)
            place = self.at(x, y)
            for step in (30, 15, 5):
                self.tab.hover(place[0] - step, place[1] - step)
                time.sleep(0.15)
            self.shown(250, place)
            version = track.version
            self.tab.click(*place, button="left" if inside else "right")
            self.wait(lambda before=version: track.version > before)
            clicks += 1
            self.settle()
            self.shown(700, place)
            mask = self.mask()
        self.clicks.append(clicks)
        before = self.index()
        self.tab.press("a" if mask.any() else "s")
        self.tab.until(f"location.hash !== '#0/{before}'")

    def settle(self) -> None:
        """Let the page draw what it has asked for."""
        time.sleep(0.6)

    @staticmethod
    def wait(done: Any, seconds: float = 60) -> None:
        """Until it is so."""
        end = time.monotonic() + seconds
        while not done() and time.monotonic() < end:
            time.sleep(0.05)


def film(frames: Sequence[tuple[Image.Image, int]], path: Path) -> None:
    """Write the animation."""
    first, *rest = [frame for frame, _ in frames]
    times = [ms for _, ms in frames]
    first.save(
        path, save_all=True, append_images=rest, duration=times, loop=0, quality=55, method=6, minimize_size=True
    )


def told(stranger: Stranger, accepted: int) -> None:
    """Print what came of it."""
    hand = sum(stranger.clicks) * A_CLICK_S + accepted * A_LOOK_S
    print(
        f"{accepted} images picked with {sum(stranger.clicks)} clicks ({stranger.clicks}): {hand / 60:.1f} minutes of a hand"
    )
    print(f"proposed before the first click: {', '.join(f'{one:.2f}' for one in stranger.proposed)}")
    times = stranger.tab.value("ffsegTimes")
    quick = [one for one in times if one["quick"]]
    if quick:
        stages = {
            key: (median(one[key] for one in quick), sorted(one[key] for one in quick)[int(0.9 * len(quick))])
            for key in ("waited", "server", "asked", "all")
        }
        print(
            "ms from the hand to the contour, median and nine tenths: "
            + ", ".join(f"{key} {a:.0f} {b:.0f}" for key, (a, b) in stages.items())
        )


def picked(tab: chromium.Chromium, out: Path, kind: str, count: int, accepted: int, target: Path | None) -> None:
    """The whole way: pick, learn, run."""
    truths = drawn(out / "photos", kind, count)
    with Session([str(out / "photos")], str(out / "picked"), load_params()) as session, Server(session) as server:
        server.begin()
        tab.open(server.address)
        tab.until("document.body.dataset.ready === 'yes'")
        stranger, work = Stranger(tab, server, truths), session._work[0]
        stranger.filming = target is not None
        for number in range(accepted):
            stranger.one_image()
            if number:
                stranger.wait(lambda: not work._learning.running, 600)
                time.sleep(2)
            print(f"{number + 1}: {work.line}", flush=True)
        stranger.shown(1500)
        told(stranger, accepted)
        tab.value("document.getElementById('run').click()")
        time.sleep(1)
        begin = time.monotonic()
        stranger.wait(lambda: not work.runs, 1800)
        print(f"{work.line} in {time.monotonic() - begin:.0f} s")
        time.sleep(2)
        for _ in range(6):
            stranger.shown(600)
            tab.press("n")
            time.sleep(0.8)
        results = [
            cv2.imread(str(out / "picked" / "run" / "masks" / f"{number:03d}.png"), 0) > 127 for number in range(count)
        ]
        ious = [overlap(mask, truth) for mask, truth in zip(results, truths, strict=True)]
        print(
            f"IoU of all {count}: mean {mean(ious):.3f}, median {median(ious):.3f}, below .5: {sum(one < 0.5 for one in ious)}"
        )
        if target is not None:
            film(stranger.frames, target)
            print(f"{target}: {target.stat().st_size / 1e6:.2f} MB, {len(stranger.frames)} frames")
        server.shutdown()


def many(tab: chromium.Chromium, out: Path, count: int) -> None:
    """A folder of many images: how long the page takes to open, to list, to go on."""
    truths = drawn(out / "first", "street", 1)
    data = (out / "first" / "000.jpg").read_bytes()
    (out / "photos").mkdir()
    for number in range(count):
        (out / "photos" / f"{number:05d}.jpg").write_bytes(data)
    begin = time.monotonic()
    with Session([str(out / "photos")], str(out / "picked"), load_params()) as session, Server(session) as server:
        server.begin()
        opened = time.monotonic()
        tab.open(server.address)
        tab.until("document.body.dataset.ready === 'yes'")
        ready = time.monotonic()
        stranger = Stranger(tab, server, truths * count)
        taken = []
        for _ in range(20):
            before, start = stranger.index(), time.monotonic()
            tab.press("s")
            tab.until(f"location.hash !== '#0/{before}' && document.getElementById('picture').complete")
            taken.append(time.monotonic() - start)
        start = time.monotonic()
        tab.press("l")
        tab.until("document.querySelectorAll('#names li').length === 300")
        print(
            f"{count} images: {opened - begin:.2f} s to find them, {ready - opened:.2f} s to the page, "
            f"{median(taken):.2f} s to the next image, {time.monotonic() - start:.2f} s to the list; problems {tab.problems}"
        )
        server.shutdown()


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--kind", default="street")
    parser.add_argument("--images", type=int, default=200)
    parser.add_argument("--accept", type=int, default=5)
    parser.add_argument("--film", type=Path)
    parser.add_argument("--many", type=int, default=0)
    chosen = parser.parse_args()
    chosen.out.mkdir(parents=True)
    program = chromium.find()
    if program is None:
        sys.exit("no Chromium on the search path; install it, or name one in the environment variable FFSEG_CHROMIUM")
    with chromium.Chromium(program, chosen.out / "profile", WINDOW) as tab:
        if chosen.many:
            many(tab, chosen.out, chosen.many)
        else:
            picked(tab, chosen.out, chosen.kind, chosen.images, chosen.accept, chosen.film)


if __name__ == "__main__":
    main()
