"""The pipeline reads downwards: what a step calls lies on its own floor or a lower one."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path
from types import FrameType
from typing import Any

import cv2
import numpy as np
import pytest

import ffseg
from ffseg.samples.scenes import SCENES
from tests.scenes import START, START_RADIUS, scene

ROOT = Path(__file__).resolve().parents[2]
MOST_FILES = 38
"""Its parameters read, a drawn image enters 27 files of the package, a photograph 38: reading them all is still an afternoon."""


def floors() -> list[list[str]]:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]["contracts"]
    layers = next(one["layers"] for one in contracts if one["type"] == "layers")
    return [re.findall(r"ffseg\.(\w+)", layer) for layer in layers]


def floor_of(path: str, plan: list[list[str]]) -> int:
    room = path.partition("/")[0].removesuffix(".py")
    return next(number for number, rooms in enumerate(plan) if room in rooms)


def textured() -> np.ndarray:
    """Nothing that clear edges decide."""
    return np.random.default_rng(1).integers(60, 190, (120, 160, 3)).astype(np.uint8)


@pytest.mark.parametrize("image", [scene(0).image, textured()], ids=["drawn", "textured"])
def test_no_call_goes_back_up_to_a_higher_floor(image: np.ndarray) -> None:
    plan, upwards, entered = floors(), set(), set()
    start = {"init.center": list(START), "init.radius": START_RADIUS} if image.shape[0] > START[1] else {}
    params = ffseg.load_params(None, start)

    def watch(frame: FrameType, event: str, _: Any) -> None:
        name, caller = inside(frame), inside(frame.f_back)
        if event == "call" and name:
            entered.add(name)
            if caller and floor_of(name, plan) < floor_of(caller, plan):
                upwards.add((caller, name))

    ffseg.segment(image, params)  # loads what is loaded once
    sys.setprofile(watch)
    try:
        ffseg.segment(image, params)
    finally:
        sys.setprofile(None)
    assert "pipeline.py" in entered
    assert upwards == set()
    assert len(entered) <= MOST_FILES


def inside(frame: FrameType | None) -> str:
    """File of the package that a frame runs in; empty elsewhere."""
    path = frame.f_code.co_filename if frame else ""
    name = path.removeprefix(f"{Path(ffseg.__file__).parent}/")
    return name if name != path and name.endswith(".py") and name != "__init__.py" else ""


def test_the_twelve_files_of_the_page_are_there() -> None:
    page = (ROOT / "docs" / "pipeline.md").read_text("utf-8")
    part = page.partition("## Twelve files")[2].partition("## ")[0]
    named = re.findall(r"`([\w/]+\.(?:py|cpp))`", part)
    assert len(named) == 12
    assert all((ROOT / "ffseg" / name).is_file() for name in named)


def test_paper_and_peers_do_not_see_what_was_learned(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ffseg.evidence.prior.prior_view", lambda *_: pytest.fail("the prior was asked"))
    image = textured()
    for method in ("paper", "cv_floodfill"):
        assert ffseg.segment(image, method=method).source == "gradient"
        assert ffseg.segment(image, {"method": method}).source == "gradient"


@pytest.mark.skipif(sys.platform != "linux", reason="other C libraries keep memory in other ways")
def test_a_loop_keeps_the_memory_of_one_image_for_the_next(tmp_path: Path) -> None:
    """Given back and taken anew, the planes of 800x600 pixels are 500 pages, as much work as the edges themselves."""
    cv2.imwrite(str(tmp_path / "image.png"), SCENES["toy"]().image)
    code = """
import resource, ffseg
image, seen = ffseg.read_image("image.png"), []
for _ in range(20):
    ffseg.segment(image)
    seen.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)
print((seen[-1] - seen[9]) / 10)
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, capture_output=True, text=True)
    assert float(done.stdout) < 40
