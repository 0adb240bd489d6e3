"""What is read out of tar files: images by every command, and the files that belong to them by their names."""

from __future__ import annotations

import tarfile
from pathlib import Path

import cv2
import numpy as np
import pytest

from ffseg.batch.discover import discover
from ffseg.batch.inputs.reading import parted, read_input, told
from ffseg.errors import ImageReadError
from ffseg.parameters import load_params

NAMES = ("a", "sub/b")
SHAPE = (60, 80)
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]
INSIDE = (COLUMNS - 40) ** 2 + (ROWS - 30) ** 2 <= 20**2


def written(folder: Path, levels: np.ndarray, suffix: str = ".png") -> Path:
    for name in NAMES:
        path = folder / f"{name}{suffix}"
        path.parent.mkdir(parents=True, exist_ok=True)
        if suffix == ".npy":
            np.save(path, levels)
        else:
            cv2.imwrite(str(path), levels)
    return folder


def packed(*folders: Path) -> Path:
    """The first folder as a tar file beside it, with the files of the others."""
    path = folders[0].with_name(f"{folders[0].name}.tar")
    with tarfile.open(path, "w") as archive:
        for folder in folders:
            archive.add(folder, ".")
    return path


@pytest.fixture
def images(tmp_path: Path) -> Path:
    """A bright disc, twice."""
    return written(tmp_path / "in", np.where(INSIDE, 200, 40).astype(np.uint8))


@pytest.fixture
def truths(tmp_path: Path) -> Path:
    return written(tmp_path / "truth", np.where(INSIDE, 255, 0).astype(np.uint8))


def test_a_member_is_read_by_one_text(images: Path, tmp_path: Path) -> None:
    folder = tmp_path / "a.tar"  # a folder of such a name, and members of such a folder
    folder.mkdir()
    images.rename(tmp_path / "b.tar")
    (tmp_path / "c").mkdir()
    (tmp_path / "b.tar").rename(tmp_path / "c" / "b.tar")
    archive = packed(tmp_path / "c").rename(folder / "c.TAR")
    found = {source.name: source for source in discover([str(archive)])}
    assert sorted(found) == ["b.tar/a.png", "b.tar/sub/b.png"]
    source = found["b.tar/a.png"]
    assert parted(source.content) == (str(archive), "b.tar/a.png", source.span)
    assert read_input(source.content, 1 << 20) == (tmp_path / "c" / "b.tar" / "a.png").read_bytes()
    assert told(source.content) == f"{archive}/b.tar/a.png"
    plain = folder / "x.png#1+2"
    plain.write_bytes(b"whole")
    assert parted(str(plain)) == (str(plain), "", None)
    assert read_input(str(plain), 1 << 20) == b"whole"
    archive.unlink()
    with pytest.raises(ImageReadError, match="no such file"):
        read_input(source.content, 1 << 20)


def test_methods_are_compared_on_images_in_a_tar_file(
    images: Path, truths: Path, tmp_path: Path, ffseg_command
) -> None:
    archive = packed(images)
    command = (
        "compare",
        archive,
        "--out",
        tmp_path / "out",
        "--truth",
        truths,
        "--methods",
        "freeform",
        "--min-iou",
        "0.9",
    )
    done = ffseg_command(*command, "--set", "init.radius=8")
    assert done.returncode == 0, done.stderr + done.stdout


def test_learning_takes_images_in_a_tar_file(images: Path, truths: Path) -> None:
    from ffseg.batch.learning.gather import gather

    found = gather([str(packed(images))], str(truths), load_params())
    assert [one.name for one in found.labelled] == ["a.png", "sub/b.png"]
    np.testing.assert_array_equal(found.labelled[0].truth == 255, INSIDE)
