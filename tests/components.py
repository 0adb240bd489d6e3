"""Components from masks of whole images."""

import numpy as np

from ffseg.arrays import Mask
from ffseg.image.components import Component


def component_of(index: int, mask: Mask) -> Component:
    """What a mask of the whole image holds, as a component."""
    rows, columns = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
    if not len(rows):
        return Component(index, (0, 0), np.zeros((0, 0), np.bool_))
    window = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return Component(index, (int(columns[0]), int(rows[0])), window.copy())
