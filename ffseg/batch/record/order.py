"""The order of images as text: sorting it needs neither the plan nor the files."""

from __future__ import annotations

from ffseg.batch.plan.discover import natural_key

_END, _PART, _NUMBER = "\x00\x00", "\x00\x01", "\x00\x02"
"""Marks after a piece of a name; they begin with what no name holds, so that a shorter piece comes first."""


def order_key(place: int, name: str) -> str:
    """Text that sorts images by the input they were found under, then by their names in natural order.

    Parameters
    ----------
    place : int
        Number of the input.
    name : str
        Relative name of the image.
    """
    return f"{place:09d}" + _PART.join(_part(part) for part in natural_key(name))


def _part(pieces: tuple[tuple[bool, int, str], ...]) -> str:
    text = ""
    for is_number, value, piece in pieces:
        text += f"{_NUMBER}{len(str(value)):04d}{value}{piece}{_END}" if is_number else piece
    return text
