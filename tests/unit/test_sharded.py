"""Short forms of the campaigns on shards: every number and executor, and many tiny images packed."""

from __future__ import annotations

from pathlib import Path

from tests.campaigns import packed, sharded


def test_short_campaign_of_shards(tmp_path: Path) -> None:
    figures = sharded.campaign(tmp_path, 9, (2,), ("processes",))
    assert figures.faults == []
    assert (figures.merged, figures.shards) == (2, 6)


def test_a_tree_that_differs_is_a_fault() -> None:
    """What the campaign looks for is what it finds."""
    one, other = {"a": b"1", "b": b"see .ffseg/errors.log"}, {"a": b"2", "b": b"see .ffseg/shards/1-of-2/errors.log"}
    assert sharded._differences(one, other, 2) == ["a differs"]
    assert sharded._differences(one, {}, 2) == ["a differs", "b differs"]


def test_short_campaign_of_packed_shards(tmp_path: Path) -> None:
    options = packed.parser().parse_args(["--work", str(tmp_path), "--images", "120", "--shards", "2", "--whole"])
    figures = packed.campaign(options)
    assert figures.faults == []
    assert figures.most_redone <= options.jobs
    with (tmp_path / "out" / "masks.tar").open("r+b") as file:
        file.seek(600)
        file.write(b"\xff")
    assert packed.check(tmp_path / "out", options)
    assert packed.differing(tmp_path / "out", tmp_path / "one") == ["masks.tar differs"]
