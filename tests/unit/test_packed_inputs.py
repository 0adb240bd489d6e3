"""What is read out of tar files: images by every command, and the files that belong to them by their names."""

import tarfile
from pathlib import Path

import numpy as np
import pytest
from batches import run_batch, table
from commands import Command

from ffseg.batch.plan.beside import find_evidence, find_truths
from ffseg.batch.plan.discover import discover
from ffseg.batch.plan.jobs import make_plan
from ffseg.batch.plan.reading import display_path, read_input, split_member_path
from ffseg.errors import ImageReadError, UsageError
from ffseg.learning.gather import gather
from ffseg.parameter_files import load_params
from tests.masks import write_image

INPROCESS = "inprocess"
NAMES = ("a", "sub/b")
SHAPE = (60, 80)
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]
INSIDE = (COLUMNS - 40) ** 2 + (ROWS - 30) ** 2 <= 20**2


def written(folder: Path, levels: np.ndarray) -> Path:
    for name in NAMES:
        write_image(folder / f"{name}.png", levels)
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
    return written(tmp_path / "in", np.where(INSIDE, 200, 40).astype(np.uint8))


@pytest.fixture
def truths(tmp_path: Path) -> Path:
    return written(tmp_path / "truth", INSIDE)


def test_a_member_is_read_by_one_text(images: Path, tmp_path: Path) -> None:
    folder = tmp_path / "a.tar"  # a folder of such a name, and members of such a folder
    folder.mkdir()
    (tmp_path / "c").mkdir()
    images.rename(tmp_path / "c" / "b.tar")
    archive = packed(tmp_path / "c").rename(folder / "c.TAR")
    found = {source.name: source for source in discover([str(archive)])}
    assert sorted(found) == ["b.tar/a.png", "b.tar/sub/b.png"]
    source = found["b.tar/a.png"]
    assert split_member_path(source.content) == (str(archive), "b.tar/a.png", source.span)
    assert read_input(source.content, 1 << 20) == (tmp_path / "c" / "b.tar" / "a.png").read_bytes()
    assert display_path(source.content) == f"{archive}/b.tar/a.png"
    plain = folder / "x.png#1+2"
    plain.write_bytes(b"whole")
    assert (split_member_path(str(plain)), read_input(str(plain), 1 << 20)) == ((str(plain), "", None), b"whole")
    archive.unlink()
    with pytest.raises(ImageReadError, match="no such file"):
        read_input(source.content, 1 << 20)


def test_methods_are_compared_on_a_tar_file(images: Path, truths: Path, tmp_path: Path, ffseg_command: Command) -> None:
    shown = ("--methods", "freeform", "--min-iou", "0.9", "--set", "init.radius=8")
    ffseg_command("compare", packed(images), "--out", tmp_path / "out", "--truth", truths, *shown, code=0)


def test_what_a_folder_would_leave_out_is_left_out_of_its_tar_file(images: Path, tmp_path: Path) -> None:
    """Outputs of earlier runs, folders that are to be skipped and hidden ones were images of it."""
    written(images / "truth", np.zeros(SHAPE, np.uint8))
    (images / "truth" / ".ffseg-skip").touch()
    written(images / ".hidden", np.zeros(SHAPE, np.uint8))
    run_batch(images, images / "out", executor=INPROCESS)
    names = [source.name for source in discover([str(images)])]
    assert (names, [source.name for source in discover([str(packed(images))])]) == (["a.png", "sub/b.png"], names)


def test_learning_takes_images_in_a_tar_file(images: Path, truths: Path) -> None:
    found = gather([str(packed(images))], str(truths), load_params())
    assert [one.name for one in found.labelled] == ["a.png", "sub/b.png"]
    np.testing.assert_array_equal(found.labelled[0].truth == 255, INSIDE)


def overlaps(out: Path) -> list[str]:
    return [row["iou"] for row in table(out / "timings.csv")]


def test_truths_in_a_tar_file_are_those_of_its_folder(images: Path, truths: Path, tmp_path: Path) -> None:
    archive, options = packed(truths), {"executor": INPROCESS}
    run_batch(images, tmp_path / "one", truth=str(truths), **options)
    assert run_batch(images, tmp_path / "out", truth=str(archive), **options).done == 2
    assert overlaps(tmp_path / "out") == overlaps(tmp_path / "one")
    assert all(float(overlap) > 0 for overlap in overlaps(tmp_path / "out"))
    assert run_batch(packed(images), tmp_path / "out", truth=str(archive), **options).unchanged == 2
    write_image(tmp_path / "all.png", np.ones(SHAPE, np.bool_))
    with tarfile.open(archive, "a") as more:  # the whole image is inside
        more.add(tmp_path / "all.png", "./a.png")
    assert run_batch(images, tmp_path / "out", truth=str(archive), **options).unchanged == 2
    now, before = overlaps(tmp_path / "out"), overlaps(tmp_path / "one")
    assert (now[0] != before[0], now[1] == before[1]) == (True, True)
    run_batch(images, tmp_path / "out", **options)
    assert overlaps(tmp_path / "out") == now, "the mask is what it was"


def test_images_and_truths_may_share_a_tar_file(images: Path, truths: Path, tmp_path: Path) -> None:
    for name in NAMES:
        (truths / f"{name}.png").rename(truths / f"{name}_truth.png")
    archive = packed(images, truths)
    plan = make_plan([str(archive)], str(tmp_path / "out"), truth=str(archive))
    assert [(job.source.name, display_path(job.truth)) for job in plan.jobs] == [
        (f"{name}.png", f"{archive}/{name}_truth.png") for name in NAMES
    ]


def test_a_true_mask_in_a_tar_file_that_cannot_be_used_is_named(images: Path, truths: Path, tmp_path: Path) -> None:
    (truths / "a.png").write_text("not an image")
    archive = packed(truths)
    run_batch(images, tmp_path / "out", truth=str(archive), executor=INPROCESS)
    error = table(tmp_path / "out" / "timings.csv")[0]["error"]
    assert error.startswith(f"truth: the true mask {archive}/a.png cannot be used: not-an-image")


def test_what_is_no_tar_file_that_can_be_read_in_place_is_refused(images: Path, truths: Path, tmp_path: Path) -> None:
    sources = discover([str(images)])
    for find, option in ((find_truths, "--truth"), (find_evidence, "--evidence")):
        with pytest.raises(UsageError, match=f"{option}: there is no folder or tar file"):
            find(sources, str(tmp_path / "none.tar"))
        with tarfile.open(tmp_path / "truth.tar.gz", "w:gz") as archive:
            archive.add(truths, ".")
        with pytest.raises(UsageError, match="is compressed"):
            find(sources, str(tmp_path / "truth.tar.gz"))
        with tarfile.open(tmp_path / "other.tar", "w") as archive:
            archive.add(truths, "truth")  # one folder too deep
        with pytest.raises(UsageError, match=r"NAME\.png"):
            find(sources, str(tmp_path / "other.tar"))


def test_links_in_an_archive_are_followed_as_in_its_folder(images: Path, tmp_path: Path) -> None:
    (images / "hard.png").hardlink_to(images / "a.png")
    (images / "sub" / "soft.png").symlink_to("../a.png")
    (images / "again.png").symlink_to("sub/soft.png")
    (images / "folder").symlink_to("sub")
    (images / "outside.png").symlink_to(tmp_path / "none.png")
    (images / "loop.png").symlink_to("loop.png")
    archive = packed(images)
    for name, inputs in (("one", images), ("two", archive)):
        run_batch(inputs, tmp_path / name, executor=INPROCESS)
    one, two = (table(tmp_path / name / "timings.csv") for name in ("one", "two"))
    told = [[(row["image"], row["status"], row["area_px"]) for row in rows] for rows in (one, two)]
    assert told[0] == told[1]
    said = {row["image"]: row["error"] for row in two if row["status"] == "failed"}
    assert set(said) == {"loop.png", "outside.png"}
    assert "none.png, which is no file in the archive; pack it too" in said["outside.png"]


@pytest.mark.parametrize("kind", [tarfile.XHDTYPE, tarfile.XGLTYPE])
def test_headers_without_end_are_refused_in_one_sentence(kind: bytes, tmp_path: Path) -> None:
    header = tarfile.TarInfo("headers")
    header.type = kind
    path = tmp_path / "a.tar"
    path.write_bytes(header.tobuf(tarfile.USTAR_FORMAT) * 20_000 + bytes(1024))
    with pytest.raises(UsageError, match=r"a\.tar has more headers for one member than can be read; pack it again"):
        discover([str(path)])


def test_a_member_two_thousand_folders_deep_costs_only_itself(images: Path, tmp_path: Path) -> None:
    path = packed(images)
    with tarfile.open(path, "a") as archive:
        archive.add(images / "a.png", "d/" * 2000 + "c.png")
    run_batch(path, tmp_path / "out", executor=INPROCESS)
    rows = table(tmp_path / "out" / "timings.csv")
    assert sorted(row["status"] for row in rows) == ["failed", "ok", "ok"]
    assert "folders deep" in next(row["error"] for row in rows if row["status"] == "failed")
