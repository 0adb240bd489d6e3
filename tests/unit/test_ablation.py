"""Which scene fails without a rule of the core, and the processes that measure it."""

from pathlib import Path

import pytest

from ffseg.native import _core
from tests.campaigns.ablation import Rule, row, told
from tests.campaigns.grounds import scenes


def test_the_first_scene_is_filled_by_the_whole_method() -> None:
    name, judge = next(scenes({}))
    assert name == "spiral of 6.5 px"
    assert judge() > 0.99


def test_a_row_names_the_scene_that_loses_most() -> None:
    whole = {"a": 1.0, "b": 0.9, "c": 0.5}
    assert told(whole, {"a": 0.98, "b": 0.2, "c": 0.5}) == "b | 0.900 | 0.200 | 2"
    assert told(whole, whole) == "none | | | 0"


def test_a_process_that_fails_is_not_told_as_one_that_does_not_end() -> None:
    with pytest.raises(RuntimeError, match=r"contour\.settled"):
        row(Path(_core.__file__), Rule("wrong", settings={"contour.settled": 1}))
