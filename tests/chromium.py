"""A headless Chromium driven over its debugging pipe: no package and no port, only the browser itself."""

import json
import os
import select
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
_WAIT = 60.0
"""Seconds an answer may take: a cold start on a busy machine is the slowest."""

_START = """
import os, sys
for given, number in zip(sys.argv[1:3], (103, 104)):
    os.dup2(int(given), number)  # out of the way first: what is given may itself be 3 or 4
for given, number in ((103, 3), (104, 4)):
    os.dup2(given, number)
os.closerange(5, 256)
os.execvp(sys.argv[3], sys.argv[3:])
"""
"""Puts the pipes where the browser looks for them: it reads commands from descriptor 3 and answers on 4."""


def find() -> str | None:
    """The browser: what FFSEG_CHROMIUM names, or the first one on the search path."""
    return os.environ.get("FFSEG_CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)


class Chromium:
    """One browser with one tab.

    Attributes
    ----------
    problems : list of str
        Console errors and uncaught exceptions so far.
    requests : list of str
        Addresses the tab has asked for.
    """

    def __init__(self, program: str, profile: Path, size: tuple[int, int] = (1400, 1000)) -> None:
        to_browser, self._write = os.pipe()
        self._read, from_browser = os.pipe()
        flags = [
            "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--remote-debugging-pipe",
            "--no-first-run", "--hide-scrollbars", f"--user-data-dir={profile}", f"--window-size={size[0]},{size[1]}",
        ]  # fmt: skip
        self._process = subprocess.Popen(
            [sys.executable, "-c", _START, str(to_browser), str(from_browser), program, *flags, "about:blank"],
            pass_fds=(to_browser, from_browser),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(to_browser)
        os.close(from_browser)
        self._buffer, self._last, self._session = b"", 0, ""
        self.problems: list[str] = []
        self.requests: list[str] = []
        self._attach()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.terminate()
        self._process.wait(timeout=_WAIT)
        os.close(self._write)
        os.close(self._read)

    def _attach(self) -> None:
        deadline = time.monotonic() + _WAIT
        while not (pages := self._pages()) and time.monotonic() < deadline:
            time.sleep(0.02)
        self._show(pages[0])

    def _pages(self) -> list[str]:
        targets = self.call("Target.getTargets")["targetInfos"]
        return [target["targetId"] for target in targets if target["type"] == "page"]

    def renew(self) -> None:
        """Go on in a new tab, with no problem and no request; the others are closed."""
        self._session = ""
        old, new = self._pages(), self.call("Target.createTarget", {"url": "about:blank"})["targetId"]
        for page in old:
            with suppress(RuntimeError):  # one that a page has opened may be gone by now
                self.call("Target.closeTarget", {"targetId": page})
        self._show(new)
        self.problems.clear()
        self.requests.clear()

    def _show(self, page: str) -> None:
        self._session = self.call("Target.attachToTarget", {"targetId": page, "flatten": True})["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, parameters: dict[str, Any] | None = None) -> dict[str, Any]:
        """Run one command and return its result; events on the way are noted."""
        self._last += 1
        message: dict[str, Any] = {"id": self._last, "method": method, "params": parameters or {}}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        deadline = time.monotonic() + _WAIT  # events may go on while the answer never comes
        while True:
            answer = self._next(deadline, method)
            if answer.get("id") == self._last:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return dict(answer["result"])
            self._note(answer)

    def _next(self, deadline: float, asked: str) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            if not select.select([self._read], [], [], max(deadline - time.monotonic(), 0.0))[0]:
                raise TimeoutError(f"the browser does not answer to {asked}")
            piece = os.read(self._read, 1 << 16)
            if not piece:
                raise RuntimeError("the browser has gone")
            self._buffer += piece
        first, _, self._buffer = self._buffer.partition(b"\0")
        return dict(json.loads(first))

    def _note(self, event: dict[str, Any]) -> None:
        if event.get("sessionId") != self._session:  # of a tab that was closed
            return
        parameters = event.get("params", {})
        if event.get("method") == "Runtime.exceptionThrown":
            self.problems.append(str(parameters["exceptionDetails"]))
        elif event.get("method") == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.problems.append(f"{parameters['entry']['text']} {parameters['entry'].get('url', '')}")
        elif event.get("method") == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "assert"):
            self.problems.append(str(parameters["args"]))
        elif event.get("method") == "Network.requestWillBeSent":
            self.requests.append(parameters["request"]["url"])

    def open(self, address: str) -> None:
        """Go to a page and wait until it has loaded."""
        self._leave("Page.navigate", {"url": address})

    def reload(self) -> None:
        """Load the page anew and wait until it has loaded."""
        self._leave("Page.reload", {})

    def _leave(self, method: str, parameters: dict[str, Any]) -> None:
        """Until the new document is there, the browser answers for the old one, which has loaded long ago."""
        self.value("window.isLeft = true")
        answer = self.call(method, parameters)
        if "errorText" in answer:
            raise RuntimeError(f"{parameters}: {answer['errorText']}")
        left = "true" if method == "Page.navigate" and "loaderId" not in answer else "!window.isLeft"
        self.until(f"{left} && document.readyState === 'complete'")

    def value(self, script: str) -> Any:
        """Value of an expression in the page; promises are awaited."""
        parameters = {"expression": script, "returnByValue": True, "awaitPromise": True, "userGesture": True}
        answer = self.call("Runtime.evaluate", parameters)
        if "exceptionDetails" in answer:
            raise AssertionError(f"{script}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def until(self, script: str) -> None:
        """Wait for an expression to become true, also in the document that follows this one."""
        deadline = time.monotonic() + _WAIT
        while not self._holds(script):
            if time.monotonic() > deadline:
                raise AssertionError(f"never true: {script}")
            time.sleep(0.02)

    def _holds(self, script: str) -> bool:
        try:
            return bool(self.value(script))
        except RuntimeError as error:
            if "context" in str(error) or "navigated" in str(error):  # the document was left meanwhile
                return False
            raise

    def press(self, key: str) -> None:
        text = {"text": key} if len(key) == 1 else {"text": "\r"} if key == "Enter" else {}
        codes = {"Enter": 13, "Escape": 27, "ArrowLeft": 37, "ArrowRight": 39, "ArrowDown": 40}
        code = codes.get(key, ord(key[0].upper()))
        for kind in ("keyDown", "keyUp"):
            more = text if kind == "keyDown" else {}
            self.call("Input.dispatchKeyEvent", {"type": kind, "key": key, "windowsVirtualKeyCode": code, **more})

    def touch(self, kind: str, *points: tuple[float, float]) -> None:
        """Fingers ``touchStart`` and ``touchMove`` at points of the window, and ``touchEnd`` all together."""
        fingers = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(points)]
        self.call("Input.dispatchTouchEvent", {"type": kind, "touchPoints": fingers})

    def hover(self, x: float, y: float) -> None:
        self.call("Input.dispatchMouseEvent", {"type": "mouseMoved", "x": x, "y": y})

    def mouse(self, kind: str, x: float, y: float, button: str = "none", modifiers: int = 0) -> None:
        held = {"none": 0, "left": 1, "right": 2, "middle": 4, "forward": 16}[button] if kind != "mouseReleased" else 0
        parameters = {"type": kind, "x": x, "y": y, "button": button, "buttons": held, "modifiers": modifiers}
        self.call("Input.dispatchMouseEvent", parameters | ({} if kind == "mouseMoved" else {"clickCount": 1}))

    def click(self, x: float, y: float, button: str = "left", modifiers: int = 0) -> None:
        """Press and release a button of the mouse; of the modifiers 1 is Alt, 8 is Shift."""
        self.drag([(x, y), (x, y)], button, modifiers)

    def drag(self, places: Sequence[tuple[float, float]], button: str = "left", modifiers: int = 0) -> None:
        """Press a button at the first place, move to each of the others, and release it at the last."""
        self.mouse("mousePressed", *places[0], button, modifiers)
        for place in places[1:]:
            self.mouse("mouseMoved", *place, button, modifiers)
        self.mouse("mouseReleased", *places[-1], button, modifiers)

    def screenshot(self, path: Path) -> None:
        """Save what the tab shows as PNG."""
        import base64

        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot")["data"]))
