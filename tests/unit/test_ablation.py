"""The processes that measure what departures from the paper gain."""

from pathlib import Path

import pytest

from ffseg.native import _core
from tests.campaigns.ablation import Departure, row

CORE = Path(_core.__file__)


def test_the_method_as_it_is_has_no_fault() -> None:
    found = row(CORE, Departure("none"), 2)
    assert isinstance(found, dict)
    assert found["faulty"] == 0
    assert found["least"] > 0.99


def test_a_process_that_fails_is_not_told_as_one_that_does_not_end() -> None:
    with pytest.raises(RuntimeError, match=r"contour\.settled"):
        row(CORE, Departure("wrong", settings={"contour.settled": 1}), 1)
