"""The campaign on drawn kinds that a prior has not seen: which kinds are left out together, and how runs are compared."""

from __future__ import annotations

from ffseg.learning.drawn.sights import KINDS
from tests.campaigns.left_out import GROUPS, changed


def test_each_kind_of_a_group_is_drawn_and_left_out_once() -> None:
    names = [kind for group in GROUPS for kind in group]
    assert len(names) == len(set(names))
    assert set(names) <= set(KINDS)


def test_two_looks_at_one_picture_count_as_one() -> None:
    before = {("room", 0): 0.5, ("room", 1): 0.5, ("room", 2): 0.5, ("street", 0): 0.5}
    now = {("room", 0): 0.6, ("room", 1): 0.8, ("room", 2): 0.4, ("field", 0): 0.0}
    # changes .2 and -.1 of two pictures: mean .05, deviation .15, over the root of two
    assert changed(now, before) == "changed by +0.0500, standard error 0.1061, 2 pictures"
