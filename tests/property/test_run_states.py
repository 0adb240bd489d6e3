"""Any sequence of runs, changes, damage and kills: what is in the output folder is what its tables say, and is right."""

import json
import os
import shutil
import tarfile
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from batches import TIMES, make_images, run_batch, table
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

from ffseg.batch.outputs.table import OUTPUTS, Output, Products
from ffseg.errors import UsageError
from ffseg.io.files import printable
from ffseg.parameter_files import load_params
from ffseg.parameters import Parameters
from tests.masks import write_image

NAMES = ("a.png", "b.png", "s/d.png", "s/c.jpg")
INPROCESS = "inprocess"
EVERYTHING = Products(True, ("coco", "geojson"))

names = st.sampled_from(NAMES)
parts = st.sampled_from([None, None, *NAMES])
mostly = st.sampled_from([True, True, False])
some_products = st.builds(Products, st.booleans(), st.sampled_from([(), ("coco",), ("geojson",), ("coco", "geojson")]))


class Killed(BaseException):
    """The process is gone: nothing more reaches the disk."""


class DeadDisk:
    """Every call that changes the disk fails from the n-th on, as if the process had been killed before it."""

    CALLS = ("replace", "write", "unlink", "ftruncate", "fsync")

    def __init__(self, after: int) -> None:
        self.left = after

    def __enter__(self) -> None:
        self.patch = pytest.MonkeyPatch()
        for name in self.CALLS:
            self.patch.setattr(os, name, self._dying(getattr(os, name)))

    def __exit__(self, *_: object) -> None:
        self.patch.undo()

    def _dying(self, real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: object, **options: object) -> object:
            self.left -= 1
            if self.left < 0:
                raise Killed
            return real(*arguments, **options)

        return call


class Runs(RuleBasedStateMachine):
    """An input folder, a folder of true masks and an output folder, changed in every way there is."""

    @initialize()
    def begin(self) -> None:
        self.root = Path(tempfile.mkdtemp(prefix="ffseg-states-"))
        self.images, self.truth, self.out = self.root / "in", self.root / "truth", self.root / "out"
        self.images.mkdir()
        self.degree = 3
        self.patch = pytest.MonkeyPatch()
        self.patch.setattr(os, "fsync", lambda _: None)  # the order of what is done is tested, not the disk
        self.versions = 0
        for name in NAMES[:3]:
            self.paint(name, 0)
        for name in NAMES:
            noise = np.random.default_rng(list(name.encode())).random((12, 16)) < 0.5
            write_image((self.truth / name).with_suffix(".png"), noise)

    def teardown(self) -> None:
        self.patch.undo()
        shutil.rmtree(self.root, ignore_errors=True)

    @rule(name=names, level=st.sampled_from([0, 0, 0, 254]))
    def paint(self, name: str, level: int) -> None:
        """A new or another image; the level 254 is one that cannot be segmented."""
        self.versions += 1
        folder = self.root / f"made{self.versions}"
        make_images(folder, [f"{index}.png" for index in range(self.versions)] + [name], {name: level})
        (self.images / name).parent.mkdir(parents=True, exist_ok=True)
        os.replace(folder / name, self.images / name)

    @rule(name=names)
    def remove_image(self, name: str) -> None:
        (self.images / name).unlink(missing_ok=True)

    @rule(name=names)
    def damage_image(self, name: str) -> None:
        if (self.images / name).exists():
            (self.images / name).write_bytes(b"no longer an image")

    @rule(pick=st.integers(0, 99), gone=st.booleans())
    def damage_output(self, pick: int, gone: bool) -> None:
        files = sorted(self.listing())
        if files:
            path = self.out / files[pick % len(files)]
            path.unlink() if gone else path.write_bytes(b"somebody else's %d" % self.versions)

    @rule(products=some_products, truth=st.booleans(), overwrite=st.booleans(), part=parts)
    def run(self, products: Products, truth: bool, overwrite: bool, part: str | None) -> None:
        self.attempt(products, truth, overwrite=overwrite, part=part)

    @rule(products=some_products, overwrite=mostly, degree=st.sampled_from([2, 4]), part=parts)
    def run_with_other_parameters(self, products: Products, overwrite: bool, degree: int, part: str | None) -> None:
        before, self.degree = self.degree, degree
        if not self.attempt(products, False, overwrite=overwrite, part=part):
            self.degree = before

    @precondition(lambda self: self.inputs(None))
    @rule(products=some_products, truth=st.booleans(), overwrite=st.booleans(), after=st.integers(0, 40))
    def killed_run(self, products: Products, truth: bool, overwrite: bool, after: int) -> None:
        try:
            with DeadDisk(after):
                self.batch(products, truth, overwrite=overwrite)
        except (Killed, UsageError):
            pass
        self.attempt(products, truth, overwrite=overwrite, part=None)

    def attempt(self, products: Products, truth: bool, *, overwrite: bool, part: str | None) -> bool:
        if not self.inputs(part):
            return True
        before = self.listing()
        try:
            self.batch(products, truth, overwrite=overwrite, part=part)
        except UsageError as error:
            assert "other parameters" in str(error)
            assert not overwrite
            assert self.listing() == before
            return False
        self.check(products, truth, part)
        return True

    def inputs(self, part: str | None) -> list[str]:
        present = [name for name in NAMES if (self.images / name).exists()]
        return [name for name in present if part in (None, name)]

    def batch(self, products: Products, truth: bool, *, overwrite: bool, part: str | None = None) -> None:
        exclude = [name for name in NAMES if part not in (None, name)]
        options = {"truth": str(self.truth)} if truth else {}
        run_batch(
            self.images, self.out, params=self.params(), products=products, overwrite=overwrite, exclude=exclude,
            executor=INPROCESS, **options,
        )  # fmt: skip

    def params(self) -> Parameters:
        return load_params(None, {"contour.degree": self.degree})

    def listing(self) -> dict[str, bytes]:
        """Contents of the outputs that are there, by path."""
        folders = [self.out / output.folder for output in OUTPUTS]
        files = [path for folder in folders for path in folder.rglob("*") if path.is_file()]
        return {str(path.relative_to(self.out)): path.read_bytes() for path in files}

    def check(self, products: Products, truth: bool, part: str | None) -> None:
        """Compare the output folder with its tables, and both with a fresh run of the same images."""
        fresh = self.root / "fresh"
        shutil.rmtree(fresh, ignore_errors=True)
        options = {"truth": str(self.truth)}
        run_batch(self.images, fresh, params=self.params(), products=EVERYTHING, executor=INPROCESS, **options)
        expected = {row["image"]: row for row in table(fresh / "timings.csv")}
        rows = table(self.out / "timings.csv")
        assert [row["image"] for row in rows] == [name for name in expected if name in {row["image"] for row in rows}]
        assert {printable(name) for name in self.inputs(part)} <= {row["image"] for row in rows}
        run = json.loads((self.out / "run.json").read_text())
        stale_images = {entry["image"] for entry in run["stale"] if "image" in entry}
        stale_outputs = {entry["output"] for entry in run["stale"] if "output" in entry}
        assert not stale_images & {row["image"] for row in rows}
        there, owned = self.listing(), set()
        for row in rows:
            whole = cells(expected[row["image"]])
            assert cells(row) == {column: cell for column, cell in whole.items() if column in row}
            assert row.get("iou", "") in ("", expected[row["image"]]["iou"])
            if row["status"] == "ok":
                kinds = (products if part in (None, row["image"]) else Products()).kinds
                owned |= check_outputs(row["image"], fresh, kinds, there, stale_outputs)
                assert row.get("iou") or not truth or part not in (None, row["image"])
        for entry in run["stale"]:
            if entry["reason"] == "made with other parameters":  # these are removed, unless they are somebody else's
                stem = os.path.splitext(entry["image"])[0]
                left = {output.path(stem) for output in OUTPUTS} & there.keys()
                assert any(there[path].startswith(b"somebody else's") for path in left)
        stale_stems = {os.path.splitext(name)[0] for name in stale_images}
        for path in there.keys() - owned - stale_outputs:
            assert os.path.splitext(path.split("/", 1)[1])[0] in stale_stems, f"{path} belongs to nothing"
        made = [row["image"] for row in rows if row["status"] == "ok"]
        self.check_coco([name for name in made if coco_of(name) in there.keys() - stale_outputs])

    def check_coco(self, made: list[str]) -> None:
        if (self.out / "coco.json").exists():
            document = json.loads((self.out / "coco.json").read_text())
            assert [coco_of(image["file_name"]) for image in document["images"]] == [coco_of(name) for name in made]
        else:
            assert made == []


def check_outputs(
    name: str, fresh: Path, kinds: tuple[Output, ...], there: dict[str, bytes], stale: set[str]
) -> set[str]:
    """What is there of an image: what was asked for at least, each as a fresh run makes it or said to be stale."""
    stem = os.path.splitext(name)[0]
    found = {output.path(stem) for output in OUTPUTS} & there.keys()
    assert {kind.path(stem) for kind in kinds} <= found
    for path in found - stale:
        assert there[path] == (fresh / path).read_bytes(), path
    return found


def coco_of(name: str) -> str:
    return f"coco/{os.path.splitext(name)[0]}.json"


def cells(row: dict[str, str]) -> dict[str, str]:
    return {column: cell for column, cell in row.items() if column not in (*TIMES, "iou")}


class PackedRuns(Runs):
    """The same with outputs in tar files."""

    def listing(self) -> dict[str, bytes]:
        found = {}
        for path in sorted(self.out.glob("*.tar")):
            with tarfile.open(path) as archive:
                found |= {member.name: archive.extractfile(member).read() for member in archive.getmembers()}
        return found

    def batch(self, products: Products, truth: bool, *, overwrite: bool, part: str | None = None) -> None:
        super().batch(replace(products, pack=True), truth, overwrite=overwrite, part=part)

    @rule(pick=st.integers(0, 99), gone=st.booleans())
    def damage_output(self, pick: int, gone: bool) -> None:
        members = []
        for path in sorted(self.out.glob("*.tar")):
            with tarfile.open(path) as archive:
                members += [(path, member) for member in archive.getmembers()]
        if members:
            path, member = members[pick % len(members)]
            if gone:
                path.unlink()
            else:
                with path.open("r+b") as file:
                    file.seek(member.offset_data)
                    file.write(b"somebody else's"[: member.size])


TestRuns = Runs.TestCase
TestPackedRuns = PackedRuns.TestCase
TestRuns.settings = settings(
    max_examples=25,
    stateful_step_count=14,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    derandomize=True,
    phases=[Phase.generate],
    report_multiple_bugs=False,
)
TestPackedRuns.settings = settings(TestRuns.settings, max_examples=15)
