"""Small things in a picture in which a start of no named radius is wider than they are."""

import cv2
import numpy as np
from numpy.typing import NDArray


def small_things(noise: float = 0.0) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Three small discs, and the one that a start of a fifteenth of the shorter side in (120, 90) holds whole."""
    image, truth = np.full((180, 240, 3), (60, 50, 40), np.uint8), np.zeros((180, 240), np.uint8)
    for x, y in ((120, 90), (60, 40), (200, 150)):
        cv2.circle(image, (x, y), 8, (90, 170, 200), -1)
    cv2.circle(truth, (120, 90), 8, 1, -1)
    image = cv2.GaussianBlur(image, (0, 0), 1.0)
    drawn = np.random.default_rng(5).normal(0, noise, image.shape)
    return np.clip(image + drawn, 0, 255).astype(np.uint8), truth > 0
