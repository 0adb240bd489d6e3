"""Short form of the campaign on shards: packed, in this process; `test_shards.py` and `test_dask.py` have the other ways."""

from pathlib import Path

from tests.campaigns import sharded


def test_short_campaign_of_shards(tmp_path: Path) -> None:
    figures = sharded.campaign(tmp_path, 9, (2,), ("inprocess",), ("tar",))
    assert figures.faults == []
    assert (figures.merged, figures.shards) == (1, 3)


def test_a_tree_that_differs_is_a_fault() -> None:
    """What the campaign looks for is what it finds."""
    one, other = {"a": b"1", "b": b"see .ffseg/errors.log"}, {"a": b"2", "b": b"see .ffseg/shards/1-of-2/errors.log"}
    assert sharded._differences(one, other, 2) == ["a differs"]
    assert sharded._differences(one, {}, 2) == ["a differs", "b differs"]
