"""From a folder of 200 photographs to masks of all of them; run ``python -m tests.campaigns.tutorial --work DIR [--film FILE]``.

What the tutorial tells, done by a script at the page of `ffseg pick` in Chromium, as somebody who sees it for the first time
would: look, click what is wrong, accept, go on while a model is learned, run the folder, mend what the model was least sure
of, run it again. The script knows the truth, but of what ffseg has found it sees what the page has drawn. Printed: clicks, time
of the hand (`THOUGHT_S` before each click, `LOOK_S` for each look), time that the page was waited for, and the IoU of all masks.
``--film`` makes an animation. The photographs are drawn: of drives along streets that nothing was learned from, each with a
camera of its own, in changing light and focus.
"""

import base64
import io
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path
from statistics import mean, median

import chromium
import cv2
import numpy as np
from numpy.typing import NDArray
from pick_page import SETTLED, Hand
from PIL import Image, ImageDraw

from ffseg.learning.drawn.cameras import perspective, photographed
from ffseg.learning.drawn.clicks import Clicks
from ffseg.learning.drawn.sights import clear_of
from ffseg.learning.drawn.streets import street
from ffseg.metrics import INSIDE, iou
from tests.campaigns import harness
from tests.campaigns.harness import command, say

Mask = NDArray[np.bool_]
Picture = NDArray[np.uint8]

VIEWS, STEP_M, WIDTH = 20, 1.0, 640
"""Photographs of a drive, metres between them, and pixels across."""
GOOD, MOST_CLICKS = 0.9, 6
"""IoU with which the stranger is content, and clicks after which one gives up."""
THOUGHT_S, LOOK_S = 1.5, 2.0
"""Seconds of a hand: before a click, and for a look at an image."""
RUN_S = 300.0
"""Seconds in which a folder is done, or something is wrong."""
WINDOW, FILM_WIDTH = (1000, 800), 640
"""Pixels, of the browser and of the animation."""
LEAFED = 8
"""Images that the animation ends with."""
POINTER = ((0, 0), (0, 22), (5, 17), (9, 25), (13, 23), (9, 15), (16, 15))

DRAWN = """(() => {
    const picture = document.getElementById("picture"), region = document.getElementById("region");
    const canvas = document.createElement("canvas"), pen = canvas.getContext("2d");
    [canvas.width, canvas.height] = [picture.naturalWidth, picture.naturalHeight];
    const factor = region.transform.baseVal.numberOfItems ? region.transform.baseVal[0].matrix.a : 1;
    pen.scale(factor, factor);
    pen.fill(new Path2D(region.getAttribute("d") ?? ""), "evenodd");
    return canvas.toDataURL();
})()"""
"""The region that the page shows, as a PNG that is opaque inside."""


def photographs(count: int) -> Iterator[tuple[Picture, Picture]]:
    """Pictures and truths of drives, the same every time."""
    for number in range(count):
        drive, view = divmod(number, VIEWS)
        if view == 0:
            rng = np.random.default_rng([*b"tutorial", drive])
            scene, camera = street(rng, dusk=False), perspective(rng, road=True)
            ahead = [np.array([STEP_M * at, 0.0, 0.0]) for at in range(VIEWS)]
            scene = reduce(clear_of, ahead, scene)
        image, ground = photographed(scene, replace(camera, origin=camera.origin + ahead[view]), rng, road=False)
        size = (WIDTH, round(WIDTH * image.shape[0] / image.shape[1]))
        truth = cv2.resize(ground.astype(np.uint8) * np.uint8(INSIDE), size, interpolation=cv2.INTER_NEAREST)
        yield np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_CUBIC), np.uint8), np.asarray(truth, np.uint8)


def drawn(work: Path, count: int) -> dict[str, Picture]:
    """Truths of the photographs in ``work/photos``, by name; drawn unless they are there."""
    names = [f"{number:03d}" for number in range(count)]
    if not (work / "truth" / f"{names[-1]}.png").exists():
        for folder in (work / "photos", work / "truth"):
            folder.mkdir(parents=True, exist_ok=True)
        for name, (image, truth) in zip(names, photographs(count), strict=True):
            (work / "photos" / f"{name}.jpg").write_bytes(cv2.imencode(".jpg", image)[1].tobytes())
            (work / "truth" / f"{name}.png").write_bytes(cv2.imencode(".png", truth)[1].tobytes())
    return {name: read(work / "truth" / f"{name}.png") for name in names}


def read(path: Path) -> Picture:
    return np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), np.uint8)


@dataclass
class Stranger:
    """Somebody at the page who knows what is wanted.

    Attributes
    ----------
    pace : float
        How much of a stranger's time is taken; 0 in a hurry.
    frames : list of (picture, ms)
        Of the animation, if one is `filmed`.
    """

    hand: Hand
    truths: dict[str, Picture]
    pace: float = 1.0
    filmed: bool = False
    clicks: list[int] = field(default_factory=list)
    hand_s: float = 0.0
    waited_s: float = 0.0
    frames: list[tuple[Image.Image, int]] = field(default_factory=list)

    def spend(self, seconds: float) -> None:
        self.hand_s += seconds
        time.sleep(seconds * self.pace)

    def until(self, script: str) -> None:
        begin = time.monotonic()
        self.hand.tab.until(script)
        self.waited_s += time.monotonic() - begin

    def name(self) -> str:
        return Path(self.hand.tab.value("document.getElementById('name').textContent")).stem

    def line(self) -> str:
        return str(self.hand.tab.value("document.getElementById('line').textContent"))

    def region(self) -> Mask:
        """What the page has drawn, when it has drawn all it was asked for."""
        self.until(SETTLED)
        data = base64.b64decode(self.hand.tab.value(DRAWN).partition(",")[2])
        picture = np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED))
        return np.asarray(picture[:, :, 3] > 127)

    def shown(self, ms: int, place: tuple[float, float] | None = None) -> None:
        """Take a picture for the animation, with the pointer at a place of the window."""
        if not self.filmed:
            return
        data = base64.b64decode(self.hand.tab.call("Page.captureScreenshot")["data"])
        frame = Image.open(io.BytesIO(data)).convert("RGB")
        if place is not None:
            tip = [(place[0] + x, place[1] + y) for x, y in POINTER]
            ImageDraw.Draw(frame).polygon(tip, fill="white", outline="black")
        size = (FILM_WIDTH, round(frame.height * FILM_WIDTH / frame.width))
        self.frames.append((frame.resize(size, Image.Resampling.LANCZOS), ms))

    def look(self) -> float:
        mask = self.region()
        self.spend(LOOK_S)
        return iou(mask, self.truths[self.name()])

    def pick(self) -> None:
        """Click until content, and accept; skip what no click gets."""
        name, count, best = self.name(), 0, self.look()
        self.shown(900)
        while best < GOOD and count < MOST_CLICKS:
            self.click(self.region(), self.truths[name])
            best, count = iou(self.region(), self.truths[name]), count + 1
        self.clicks.append(count)
        time.sleep(0.3)  # a key pressed again sooner has bounced
        self.hand.tab.press("a" if best >= GOOD - 0.1 else "s")
        self.until(f"(shown => shown && !shown.startsWith('{name}.'))(document.getElementById('name').textContent)")

    def click(self, mask: Mask, truth: Picture) -> None:
        wrong = Clicks().next(mask, truth, 1.0)
        x, y = (*wrong.inside, *wrong.outside)[0][:2]
        place = self.hand.at(x, y)
        self.hand.tab.hover(*place)
        self.spend(THOUGHT_S)
        self.shown(300, place)
        marks = self.hand.tab.value("document.querySelectorAll('#marks circle').length")
        self.hand.tab.click(*place, button="left" if wrong.inside else "right")
        self.until(f"document.querySelectorAll('#marks circle').length !== {marks}")
        self.region()
        self.shown(700, place)

    def let_learn(self) -> None:
        """Wait until a model of all masks so far is there."""
        self.until("!document.getElementById('line').textContent.includes('learning from')")

    def run(self) -> None:
        self.region()
        self.shown(1200)
        self.hand.tab.value("document.getElementById('run').click()")
        begin = time.monotonic()
        self.hand.tab.until("document.getElementById('run').disabled")  # until then it may tell of an earlier run
        while not (said := self.line()).startswith("the folder is done"):
            if said.startswith("the run has failed") or time.monotonic() - begin > RUN_S:
                raise RuntimeError(said)
            time.sleep(0.2)
        self.waited_s += time.monotonic() - begin

    def leaf(self, count: int) -> None:
        for _ in range(count):
            self.hand.tab.press("n")
            self.region()
            self.shown(500)


def walk(stranger: Stranger, first: int, mended: int) -> None:
    """Pick some images, run the folder, mend those the model is least sure of, and run it again."""
    for count in (first, mended):
        for _ in range(count):
            stranger.pick()
        if count:
            stranger.let_learn()
            stranger.run()
            say(f"{stranger.line().partition(';')[0]}; {sum(stranger.clicks)} clicks so far")
    stranger.leaf(LEAFED if stranger.filmed else 0)


def results(out: Path, truths: dict[str, Picture]) -> dict[str, float]:
    """IoU of every mask: the accepted one, else that of the run."""
    paths = {name: (out / "masks" / f"{name}.png", out / "run" / "masks" / f"{name}.png") for name in truths}
    return {name: iou(read(next(p for p in both if p.exists())) > 127, truths[name]) for name, both in paths.items()}


@contextmanager
def at_the_page(work: Path, tab: chromium.Chromium, truths: dict[str, Picture]) -> Iterator[Stranger]:
    """A stranger at the page of ``ffseg pick work/photos``."""
    words = command("pick", "photos", "--out", "picked", "--no-browser")  # the page names them so
    with subprocess.Popen(words, cwd=work, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        try:
            assert server.stdout is not None
            stranger = Stranger(Hand(tab, server.stdout.readline().strip()), truths)
            yield stranger
        finally:
            server.terminate()


def write_film(frames: list[tuple[Image.Image, int]], path: Path) -> None:
    (first, *others), times = zip(*frames, strict=True)
    small = {"quality": 55, "method": 6, "minimize_size": True}
    first.save(path, save_all=True, append_images=others, duration=list(times), loop=0, **small)
    say(f"{path}: {path.stat().st_size / 1e6:.2f} MB, {len(frames)} frames, {sum(times) / 1e3:.0f} s")


def main(work: harness.Work, images: int = 200, first: int = 10, mended: int = 10, film: Path | None = None) -> int:
    """See the module."""
    program = chromium.find()
    if program is None:
        sys.exit("no Chromium on the search path; install it, or name one in the environment variable FFSEG_CHROMIUM")
    truths = drawn(work, images)
    begin = time.monotonic()
    with chromium.Chromium(program, work / "profile", WINDOW) as tab, at_the_page(work, tab, truths) as stranger:
        if film:
            stranger.filmed = True
            # it names this machine's folders
            tab.value("document.getElementById('command').style.visibility = 'hidden'")
        walk(stranger, first, mended)
    say(
        f"{sum(stranger.clicks)} clicks in {len(stranger.clicks)} images {stranger.clicks}; "
        f"{stranger.hand_s / 60:.1f} min of the hand, {stranger.waited_s / 60:.1f} min waited for, "
        f"{(time.monotonic() - begin) / 60:.1f} min by the clock"
    )
    found = list(results(work / "picked", truths).values())
    say(
        f"IoU of all {len(found)}: mean {mean(found):.3f}, median {median(found):.3f}, "
        f"below .8: {sum(one < 0.8 for one in found)}, below .5: {sum(one < 0.5 for one in found)}"
    )
    if film:
        write_film(stranger.frames, film)
    return 0


if __name__ == "__main__":
    harness.as_command(main)
