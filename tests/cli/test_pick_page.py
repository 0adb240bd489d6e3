"""``ffseg pick`` and its page in a headless Chromium: the hand, the keys, two tabs, a server that is killed."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import chromium
import pytest
from commands import Command
from pick_page import LEFT, RIGHT, Hand, ask, disc, draw, mask_of, picked, served

from ffseg.io.starts import Start, load_starts
from ffseg.picking.server import Server
from tests.discs import overlap

HOSTILE = "<img src=x onerror=alert(1)>'\"\n&amp;.png"
NAMES = ["a.png", "b.png", HOSTILE, "z.png"]
NEWS_THAT_STOPS = """(() => {
    const fetched = window.fetch;
    window.newsUnderWay = 0;
    window.fetch = async (what, ...rest) => {
        if (what !== "news") return fetched(what, ...rest);
        if (window.newsStops) return new Promise(() => {});
        window.newsUnderWay++;
        return fetched(what, ...rest).finally(() => window.newsUnderWay--);
    };
})()"""
"""From ``newsStops`` on the page hears nothing of other tabs but what its own questions tell it."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return draw(tmp_path / "in", NAMES)


@pytest.fixture
def server(folder: Path, tmp_path: Path) -> Iterator[Server]:
    with served(folder, tmp_path / "out", labels=()) as running:
        yield running


class PageHand(Hand):
    def until_marks(self, *kinds: str) -> None:
        wanted = json.dumps(" ".join(kinds))
        marks = "[...document.querySelectorAll('#marks *')].map((m) => m.getAttribute('class')).join(' ')"
        self.tab.until(f"{marks} === {wanted}")

    def until_area(self, least: float, most: float) -> None:
        """Wait for a region whose bounding box is so many pixels wide."""
        self.tab.until(
            "(() => { const region = document.getElementById('region'), drawn = region.getAttribute('d'),"
            "wide = drawn ? region.getBBox().width * region.transform.baseVal[0].matrix.a : 0;"
            f"return wide >= {least} && wide <= {most} }})()"
        )

    def until_image(self, name: str) -> None:
        self.tab.until(f"document.getElementById('name').textContent === {json.dumps(name)}")

    def go(self, key: str, name: str) -> None:
        """Press a key that opens an image of this name."""
        self.tab.press(key)
        self.until_image(name)

    def pick(self, place: tuple[int, int]) -> None:
        """Click, and wait for the start alone."""
        self.click(*place)
        self.until_marks("start")

    def until_status(self, text: str) -> None:
        self.tab.until(f"document.getElementById('status').textContent === {json.dumps(text)}")


@pytest.fixture
def hand(browser: chromium.Chromium, server: Server) -> Iterator[PageHand]:
    yield PageHand(browser, server.address)
    assert [one for one in browser.problems if "409" not in one] == []  # a step that was refused is noted at some time
    assert [one for one in browser.requests if not one.startswith((server.address, "about:"))] == []


def state(server: Server, index: int) -> dict[str, Any]:
    return dict(server.session.image(0, index)["picked"])


def test_clicks_keys_and_what_they_leave_on_the_disk(hand: PageHand, server: Server, tmp_path: Path) -> None:
    out = tmp_path / "out"
    hand.until_image("<img src=x onerror=alert(1)>'\"\\u000a&amp;.png")
    hand.go("n", "a.png")
    hand.tab.until("document.getElementById('sure').textContent === ''")
    hand.pick(LEFT)
    hand.until_area(45, 55)
    hand.tab.until("/^expected IoU [01]\\.[0-9][0-9]$/.test(document.getElementById('sure').textContent)")
    assert load_starts(out / "starts.csv", ["a.png"])["a.png"].circles == (Start(*map(float, LEFT), 2.0),)
    hand.click(*RIGHT)
    hand.until_marks("start", "start")
    hand.until_area(110, 130)
    hand.click(80, 12, button="right")
    hand.until_marks("start", "start", "not")
    hand.click(80, 110, modifiers=1)
    hand.until_marks("start", "start", "not", "not")
    hand.tab.press("z")
    hand.until_marks("start", "start", "not")
    hand.tab.press("y")
    hand.until_marks("start", "start", "not", "not")
    hand.click(*RIGHT)
    hand.until_marks("start", "not", "not")
    hand.until_area(45, 55)
    hand.go("a", "b.png")
    assert overlap(mask_of(out / "masks" / "a.png"), disc(LEFT)) > 0.95
    hand.go("s", "z.png")
    hand.go("p", "b.png")
    hand.until_status("skipped")
    hand.go("p", "a.png")
    hand.until_status("accepted")
    hand.tab.press("x")
    hand.until_marks()
    hand.until_status("")
    assert not (out / "masks" / "a.png").exists()
    hand.tab.value("document.getElementById('help').style.height = '200px'")
    hand.tab.press("?")
    hand.tab.until("document.getElementById('help').open && document.getElementById('help').scrollTop === 0")


def test_all_that_look_alike_by_a_key(hand: PageHand, server: Server, tmp_path: Path) -> None:
    """Two discs of one look: a click and a key for both, as the table says to a run."""
    hand.go("n", "a.png")
    hand.pick(LEFT)
    hand.until_area(45, 55)
    hand.tab.press("k")
    hand.until_area(110, 130)
    hand.tab.until("document.getElementById('alike').getAttribute('aria-pressed') === 'true'")
    assert state(server, 1)["alike"]
    assert load_starts(tmp_path / "out" / "starts.csv", ["a.png"])["a.png"].alike
    hand.tab.press("k")
    hand.until_area(45, 55)
    hand.tab.press("z")
    hand.until_area(110, 130)
    hand.go("a", "b.png")
    assert overlap(mask_of(tmp_path / "out" / "masks" / "a.png"), disc(LEFT) | disc(RIGHT)) > 0.95


def test_drags_are_boxes_levels_and_strokes(hand: PageHand, server: Server) -> None:
    hand.go("n", "a.png")
    hand.drag((15, 30), (40, 60), (75, 90))
    hand.until_marks("round")
    wait_for(lambda: state(server, 1)["boxes"] == ((15, 30, 75, 90),))
    hand.tab.press("x")
    hand.until_marks()
    hand.pick(LEFT)
    x, y = hand.at(*LEFT)
    hand.tab.drag([(x, y), (x, y - 20), (x, y - 50)])
    wait_for(lambda: state(server, 1)["probability"] is not None)
    assert state(server, 1)["probability"] == pytest.approx(0.4)
    hand.tab.drag([(x, y), (x, y - 20), (x, y - 20)], modifiers=8)
    wait_for(lambda: state(server, 1)["clearance"] == 10)
    hand.tab.press("x")
    hand.until_marks()
    hand.tab.press("b")
    hand.drag((100, 20), (110, 20), (120, 20))
    hand.until_area(15, 40)
    hand.tab.until("document.getElementById('sure').textContent === ''")
    wait_for(lambda: len(state(server, 1)["strokes"]) == 1)
    hand.tab.press("e")
    hand.drag((90, 20), (110, 20), (130, 20))
    hand.until_area(0, 12)
    wait_for(lambda: [one["inside"] for one in state(server, 1)["strokes"]] == [True, False])
    hand.tab.press("e")
    hand.pick(RIGHT)


def wait_for(true: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_the_contour_follows_the_hand_and_zoom_does_not_move_what_is_meant(hand: PageHand, server: Server) -> None:
    hand.go("n", "a.png")
    hand.tab.hover(*hand.at(*RIGHT))
    hand.tab.until("document.getElementById('preview').getAttribute('d')")
    assert state(server, 1)["starts"] == (), "only shown"
    hand.tab.until("ffsegTimes.length > 0")
    for key in ("+", "+", "-"):
        hand.tab.press(key)
    hand.click(*LEFT)
    wait_for(lambda: len(state(server, 1)["starts"]) == 1)
    x, y, radius = state(server, 1)["starts"][0]
    assert (x, y) == pytest.approx(LEFT, abs=0.2)
    assert 1 <= radius < 2, "who zooms in means something smaller"


OPENING_WAITS = """(() => {
    const fetched = window.fetch;
    window.open_ = new Promise((go) => { window.letOpen = go; });
    window.fetch = async (what, ...rest) => {
        if (what === "image") await window.open_;
        return fetched(what, ...rest);
    };
})()"""


def test_what_is_begun_in_one_image_is_not_kept_in_the_next(hand: PageHand, server: Server) -> None:
    hand.tab.press("b")
    at = [hand.at(*place) for place in ((20, 20), (40, 30))]
    hand.tab.mouse("mousePressed", *at[0], "left")
    hand.tab.mouse("mouseMoved", *at[1], "left")
    hand.go("n", "a.png")
    hand.tab.mouse("mouseReleased", *at[1], "left")
    hand.tab.press("b")
    hand.tab.value(OPENING_WAITS)
    hand.go("n", "")
    hand.tab.click(*at[0])
    hand.tab.press("a")
    hand.tab.value("window.letOpen()")
    hand.until_image("b.png")
    hand.click(*LEFT, button="forward")  # through the pages seen, and no more
    hand.pick(LEFT)
    wait_for(lambda: len(state(server, 2)["starts"]) == 1)
    assert [len(state(server, index)["strokes"]) for index in range(3)] == [0, 0, 0]
    assert ([len(state(server, index)["starts"]) for index in range(2)], server.session.statuses(0)) == ([0, 0], {})


def test_an_accepted_image_is_drawn_as_it_is_changed(hand: PageHand) -> None:
    hand.click(*LEFT)
    hand.until_area(45, 55)
    hand.go("a", "a.png")
    hand.tab.press("p")
    hand.until_status("accepted")
    hand.click(*RIGHT)
    hand.until_area(110, 125)
    hand.tab.press("z")
    hand.until_area(45, 55)


def test_a_blank_presses_the_button_that_has_the_focus(hand: PageHand) -> None:
    hand.tab.value("document.getElementById('brush').focus()")
    hand.tab.press(" ")
    hand.tab.until("document.getElementById('brush').getAttribute('aria-pressed') === 'true'")


def test_what_is_done_while_a_class_opens_is_for_none(browser: chromium.Chromium, folder: Path, tmp_path: Path) -> None:
    with served(folder, tmp_path / "classes", labels=["left", "right"]) as server:
        hand = PageHand(browser, server.address)
        hand.pick(LEFT)
        wait_for(lambda: len(state(server, 0)["starts"]) == 1)
        hand.tab.value(OPENING_WAITS)
        at = hand.at(*RIGHT)
        hand.go("2", "")
        hand.tab.click(*at)
        hand.tab.press("a")
        hand.tab.value("window.letOpen()")
        hand.tab.until("document.getElementById('name').textContent")
        hand.pick(RIGHT)
        wait_for(lambda: len(server.session.image(1, 0)["picked"]["starts"]) == 1)
        assert server.session.image(1, 0)["picked"]["starts"][0][:2] == pytest.approx(RIGHT, abs=0.2)
        assert server.session.statuses(1) == {}


def test_two_fingers_zoom_and_pick_nothing_one_picks(hand: PageHand, server: Server) -> None:
    """Fingers that parted set a start or drew a box where the first had been."""
    middle, (_, y) = hand.at(*LEFT), hand.at(*LEFT)
    width = "document.getElementById('layers').getBoundingClientRect().width"
    before = hand.tab.value(width)
    hand.tab.touch("touchStart", (middle[0] - 20, y))
    for kind, apart in (("touchStart", 20), ("touchMove", 40), ("touchMove", 60)):
        hand.tab.touch(kind, (middle[0] - apart, y), (middle[0] + apart, y))
    hand.tab.until(f"Math.abs({width} / {before} - 3) < 0.03")
    assert hand.at(*LEFT) == pytest.approx(middle, abs=2)
    for kind, points in (("touchEnd", []), ("touchStart", [middle]), ("touchEnd", [])):
        hand.tab.touch(kind, *points)
    hand.until_marks("start")
    wait_for(lambda: len(server.session.image(0, 0)["picked"]["starts"]) == 1)
    assert state(server, 0)["starts"][0][:2] == pytest.approx(LEFT, abs=0.5)
    assert state(server, 0)["boxes"] == ()


@pytest.mark.parametrize("key", ["Enter", "A", "s"])
def test_a_key_that_is_held_accepts_no_image_unseen(key: str, hand: PageHand, server: Server) -> None:
    event = f"new KeyboardEvent('keydown', {{key: {key!r}, repeat: true, bubbles: true}})"
    hand.pick(LEFT)
    hand.tab.value(f"document.body.dispatchEvent({event})")
    hand.tab.until("window.underWay === 0")
    assert server.session.statuses(0) == {}


def test_a_key_pressed_twice_passes_no_image_and_what_is_left_open_is_told(hand: PageHand, server: Server) -> None:
    hand.click(*LEFT)
    hand.until_area(45, 55)
    events = "['a', 'n', 's', 's'].map((key) => new KeyboardEvent('keydown', {key, bubbles: true}))"
    hand.tab.value(f"window.keyed = {events}")
    send = "document.body.dispatchEvent(window.keyed.shift())"
    hand.tab.value(f"{send}; {send}")
    for name in ("a.png", "b.png"):  # of which the second S, as soon after the first as they were made, skips none
        hand.until_image(name)
        hand.tab.until("window.underWay === 0")
        hand.until_image(name)
        hand.tab.value(send)
    hand.tab.until("window.underWay === 0")
    assert server.session.statuses(0) == {0: "accepted", 1: "skipped"}
    hand.go("S", "z.png")
    hand.tab.press("n")
    hand.tab.until("document.getElementById('said').textContent === 'all other images are accepted or skipped'")
    hand.tab.press("s")
    hand.tab.until("document.getElementById('said').textContent === 'all images are accepted or skipped'")


PEN = """(() => {
    const region = document.getElementById("region"), layers = document.getElementById("layers");
    const scale = layers.getBoundingClientRect().width / parseFloat(layers.style.width);
    return parseFloat(getComputedStyle(region).strokeWidth) * scale;
})()"""
"""Pixels of the screen that the contour is wide."""


def test_the_contour_is_as_wide_on_a_photograph_of_any_size(hand: PageHand) -> None:
    hand.click(*LEFT)
    hand.until_area(45, 55)
    assert hand.tab.value(PEN) == pytest.approx(2, rel=0.01)
    for key in "+++++-":
        hand.tab.press(key)
    assert hand.tab.value(PEN) == pytest.approx(2, rel=0.01)


def test_a_reload_and_another_tab_show_what_is_kept(hand: PageHand, server: Server) -> None:
    hand.go("n", "a.png")
    hand.pick(LEFT)
    address = hand.tab.value("location.href")
    assert address.endswith("#0/1")
    hand.tab.reload()
    hand.tab.until("document.body?.dataset.ready === 'yes'")
    hand.tab.value(NEWS_THAT_STOPS)
    hand.until_image("a.png")
    hand.until_marks("start")
    hand.tab.press("z")
    hand.until_marks()
    other = {"image": 1, "version": 2, "do": "pick", "picked": picked(LEFT, RIGHT)}
    assert ask(server, "change", other)[0] == 200, "another tab picks"
    hand.until_marks("start", "start")  # by itself
    hand.tab.value("window.newsStops = true")
    hand.tab.until("window.newsUnderWay === 0")
    assert ask(server, "change", other | {"version": 3, "picked": picked(RIGHT)})[0] == 200
    hand.click(80, 20)
    hand.tab.until("document.getElementById('said').textContent.includes('another tab')")
    hand.until_marks("start")
    hand.until_area(30, 80)
    assert "another tab" in hand.tab.value("document.getElementById('said').textContent"), "the region leaves it there"
    assert state(server, 1)["starts"] == ((*RIGHT, 6),), "nothing is lost, nothing is mixed up"


def test_a_name_of_a_class_and_the_list_of_images(browser: chromium.Chromium, folder: Path, tmp_path: Path) -> None:
    with served(folder, tmp_path / "classes", labels=["left", "right one"]) as server:
        hand = PageHand(browser, server.address)
        hand.go("n", "a.png")
        hand.pick(LEFT)
        hand.tab.press("2")
        hand.until_marks()
        hand.pick(RIGHT)
        hand.tab.press("1")
        hand.tab.press("l")
        hand.tab.value(
            "(() => { const f = document.getElementById('find'); f.value = 'Z'; f.dispatchEvent(new Event('input')) })()"
        )
        assert hand.tab.value("[...document.querySelectorAll('#names button')].map((b) => b.textContent)") == ["z.png"]
        hand.tab.value("document.querySelector('#names button').click()")
        hand.until_image("z.png")
        assert [server.session.image(kind, 1)["picked"]["starts"][0][:2] for kind in (0, 1)] == [LEFT, RIGHT]


def test_an_unreadable_image_shows_no_other_and_can_be_skipped(browser: chromium.Chromium, tmp_path: Path) -> None:
    folder = draw(tmp_path / "in", ["a.png", "b.png", "c.png"])
    (folder / "b.png").write_bytes((folder / "a.png").read_bytes()[:99])
    with served(folder, tmp_path / "out") as server:
        hand = PageHand(browser, server.address)
        hand.click(*LEFT)
        hand.until_area(45, 55)
        hand.go("a", "b.png")
        hand.until_marks()
        hand.until_area(0, 0)
        assert "copy the file again" in hand.tab.value("document.getElementById('said').textContent")
        assert not hand.tab.value("document.getElementById('picture').hasAttribute('src')")
        hand.until_status("")
        hand.go("s", "c.png")
        assert server.session.statuses(0) == {0: "accepted", 1: "skipped"}


def command(folder: Path, out: Path, *more: str) -> subprocess.Popen[str]:
    words = [sys.executable, "-m", "ffseg", "pick", str(folder), "--out", str(out), "--no-browser", *more]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_killed_servers_go_on(browser: chromium.Chromium, folder: Path, tmp_path: Path, ffseg_command: Command) -> None:
    out = tmp_path / "killed"
    first = command(folder, out)
    assert first.stdout is not None
    hand = PageHand(browser, first.stdout.readline().strip())
    refused = ffseg_command("pick", folder, "--out", out, "--no-browser")
    assert (refused.returncode, "another ffseg" in refused.stderr) == (2, True)
    hand.go("n", "a.png")
    hand.pick(LEFT)
    hand.until_area(45, 55)
    wait_for(lambda: (out / "starts.csv").is_file() and "a.png" in (out / "starts.csv").read_text())
    os.kill(first.pid, signal.SIGKILL)
    first.communicate()
    hand.click(*RIGHT)
    for place in ("line", "said"):
        hand.tab.until(f"document.getElementById('{place}').textContent.includes('does not answer')")
    hand.until_marks("start")  # what was not kept is not shown as if it were
    second = command(folder, out)
    assert second.stdout is not None
    again = PageHand(browser, second.stdout.readline().strip() + "#0/1")
    again.until_image("a.png")
    again.until_marks("start")
    again.until_area(45, 55)
    second.terminate()
    _, said = second.communicate(timeout=60)
    assert second.returncode == 0, said
    assert "the same command goes on from there" in said
