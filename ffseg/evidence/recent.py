"""What was found last, kept by the content that it follows from."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from hashlib import blake2b
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

Found = TypeVar("Found")


MAX_PIXELS = 1 << 20
"""Of an image of which something is kept: what belongs to larger ones is made anew."""


class Recent(Generic[Found]):
    """The last results, of which at most so many are kept."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._found: OrderedDict[Hashable, Found] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], Found]) -> Found:
        """What was made for a key before, or is made now."""
        try:
            found = self._found.pop(key)
        except KeyError:
            found = make()
        self._found[key] = found
        if len(self._found) > self._most:
            self._found.popitem(last=False)
        return found

    def of(self, image: NDArray[Any], key: Hashable, make: Callable[[], Found], *parts: NDArray[Any]) -> Found:
        """As `get`, of what belongs to an image, shape (H, W, ...), and further arrays; kept where it is small."""
        if image.shape[0] * image.shape[1] > MAX_PIXELS:
            return make()
        return self.get((digest_of(image, *parts), key), make)


def digest_of(*parts: NDArray[Any] | None) -> bytes:
    """Equal for arrays of equal shape and content; of masks an eighth of the bytes is digested."""
    shapes = [None if part is None else part.shape for part in parts]
    found = blake2b(repr(shapes).encode(), digest_size=16)
    for part in parts:
        if part is not None:
            found.update((np.packbits(part) if part.dtype == np.bool_ else np.ascontiguousarray(part)).data)
    return found.digest()
