"""Folders of drawn images to pick in, and sessions and servers over them."""

import http.client
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import chromium
import cv2
import numpy as np

from ffseg.parameter_files import load_params
from ffseg.picking.server import HOST, Server
from ffseg.picking.session import Session

SIZE = (120, 160)
LEFT, RIGHT = (45, 60), (115, 60)
"""Centres of two discs, of radius 25."""
OPEN: dict[str, Any] = {
    "starts": [], "nots": [], "boxes": [], "strokes": [], "probability": None, "clearance": None, "status": "open",
}  # fmt: skip


LISTEN = """(() => {
    const fetched = window.fetch;
    window.underWay = 0;
    window.fetch = (what, ...rest) => {
        if (what === "news") return fetched(what, ...rest);
        window.underWay++;
        return fetched(what, ...rest).finally(() => setTimeout(() => window.underWay--, 50));
    };
})()"""
"""Counts the page's questions that are not answered yet, or of which the answer is not drawn."""

SETTLED = "window.underWay === 0 && document.getElementById('picture').complete"
"""Nothing is asked for that is not drawn."""


def disc(centre: tuple[int, int], radius: float = 25) -> np.ndarray:
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    return np.hypot(x - centre[0], y - centre[1]) < radius


def draw(folder: Path, names: Sequence[str]) -> Path:
    """Images of two light discs on a dark ground."""
    image = np.full((*SIZE, 3), 60, np.uint8)
    image[disc(LEFT) | disc(RIGHT)] = (150, 200, 180)
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(cv2.imencode(".png", image)[1].tobytes())
    return folder


def picked(*starts: tuple[int, int], **other: object) -> dict[str, Any]:
    return OPEN | {"starts": [[*place, 6] for place in starts]} | other


def mask_of(path: Path) -> np.ndarray:
    return cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) > 0


def session(folder: Path, out: Path, **options: Any) -> Session:
    return Session([str(folder)], str(out), load_params(), **options)


@contextmanager
def served(folder: Path, out: Path, port: int = 0, **options: Any) -> Iterator[Server]:
    with session(folder, out, **options) as own, Server(own, port) as server:
        server.begin()
        yield server
        server.shutdown()


def ask(server: Server, path: str, body: object = None, **headers: str) -> tuple[int, Any]:
    """Status and content of an answer; POST with a body, else GET; `path` behind the token unless it begins with /."""
    connection = http.client.HTTPConnection(HOST, server.port, timeout=20)
    target = path if path.startswith("/") else f"/{server.token}/{path}"
    data = None if body is None else json.dumps(body).encode()
    own = {"Host": f"{HOST}:{server.port}"} | ({} if data is None else {"Content-Type": "application/json"})
    connection.request(
        "GET" if data is None else "POST", target, data, own | {k.replace("_", "-"): v for k, v in headers.items()}
    )
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, json.loads(content) if answer.headers["Content-Type"] == "application/json" else content


class Hand:
    """What a person does with the page, in pixels of the image."""

    def __init__(self, tab: chromium.Chromium, address: str) -> None:
        self.tab = tab
        tab.open(address)
        tab.until("document.body.dataset.ready === 'yes' && document.getElementById('picture').complete")
        tab.value(LISTEN)

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Where a pixel of the image stands in the window."""
        left, top, scale = self.tab.value(
            "(() => { const d = document.getElementById('drawing'), b = d.getBoundingClientRect();"
            "return [b.x, b.y, b.width / d.viewBox.baseVal.width] })()"
        )
        return left + (x + 0.5) * scale, top + (y + 0.5) * scale

    def drag(self, *places: tuple[float, float], button: str = "left", modifiers: int = 0) -> None:
        self.tab.drag([self.at(*place) for place in places], button, modifiers)

    def click(self, x: float, y: float, button: str = "left", modifiers: int = 0) -> None:
        self.drag((x, y), (x, y), button=button, modifiers=modifiers)
