"""How long an evolution may go on: ``contour.max_iterations``, and a budget of work to each pixel it may fill."""

from __future__ import annotations

import numpy as np

from ffseg.parameters import Parameters
from ffseg.scene import Scene

ENDLESS = 2**31 - 2
"""Iterations no evolution comes to before its budget is spent."""
LEAST = 10_000
"""Work in the smallest image: some hundred iterations of the patches of a start."""


def iterations(params: Parameters) -> int:
    """Iterations after which an evolution ends anyway; ``auto`` leaves that to its budget."""
    most = params.contour.max_iterations
    return ENDLESS if most == "auto" else most


def budget(scene: Scene, to_pixel: int) -> int:
    """Work after which an evolution ends anyway: so much to each pixel of the domain, and what the smallest image needs."""
    domain = scene.edges.domain
    pixels = scene.edges.edges.size if domain is None else int(np.count_nonzero(domain))
    return LEAST + to_pixel * pixels
