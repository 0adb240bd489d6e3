"""The tutorial's way through the page, in a hurry and with few images: click, accept, learn, run."""

from pathlib import Path

import chromium
import cv2
import numpy as np
import pytest
from pick_page import LEFT, SIZE, disc

from ffseg.metrics import INSIDE
from tests.campaigns.tutorial import at_the_page, results, walk

NAMES = ["a", "b", "c"]


def test_a_stranger_gets_masks_of_all_images(browser: chromium.Chromium, tmp_path: Path) -> None:
    pytest.importorskip("lightgbm")
    image = np.full(SIZE, 60, np.uint8)
    image[disc(LEFT)] = 180
    (tmp_path / "photos").mkdir()
    for name in NAMES:
        (tmp_path / "photos" / f"{name}.png").write_bytes(cv2.imencode(".png", image)[1].tobytes())
    truth = np.where(disc(LEFT), INSIDE, 0).astype(np.uint8)
    with at_the_page(tmp_path, browser, dict.fromkeys(NAMES, truth)) as stranger:
        stranger.pace = 0
        walk(stranger, 2, 0)
    assert stranger.clicks[0] == 1
    assert stranger.hand_s > 0
    found = results(tmp_path / "picked", stranger.truths)
    assert list(found) == NAMES
    assert min(found.values()) > 0.9
