"""Inputs beyond a folder: lists, tar files, URLs; what they cannot be is named, and their names stay inside DIR."""

import io
import json
import os
import sys
import tarfile
from functools import partial
from pathlib import Path

import pytest
import stand_in
from batches import images_fixture, make_images, run_batch, run_plan, snapshot, table
from commands import Command

from ffseg.batch.outputs.table import Products
from ffseg.batch.plan.discover import discover, sources_of_list
from ffseg.batch.plan.jobs import make_plan
from ffseg.batch.plan.reading import read_input
from ffseg.batch.plan.sources import natural_key
from ffseg.batch.workers.messages import Setup
from ffseg.errors import ImageReadError, UsageError
from ffseg.parameter_files import load_params

INPROCESS = "inprocess"
NAMES = ["a.png", "b/a10.png", "b/a9.png"]


images = images_fixture(NAMES)


def packed(images: Path, path: Path, names: list[str] = NAMES, mode: str = "w") -> Path:
    with tarfile.open(path, mode) as archive:
        for name in names:
            archive.add(images / name, f"./{name}")
    return path


def test_a_tar_file_is_run_like_the_folder_it_was_made_of(images: Path, tmp_path: Path) -> None:
    run_batch(images, tmp_path / "one", executor=INPROCESS)
    archive = packed(images, tmp_path / "all.tar")
    assert run_batch(archive, tmp_path / "tar", executor=INPROCESS).done == 3
    assert snapshot(tmp_path / "tar") == snapshot(tmp_path / "one")
    assert run_batch(archive, tmp_path / "tar", executor=INPROCESS).unchanged == 3
    make_images(images, ["c.png"], {"c.png": 7})
    with tarfile.open(archive, "a") as more:
        more.add(images / "c.png", "b/a9.png")  # a later member of a name replaces the earlier
        more.add(images / "c.png", "c.png")
    again = run_batch(archive, tmp_path / "tar", num_workers=2)
    assert (again.unchanged, again.done) == (2, 2)
    made = snapshot(tmp_path / "tar")
    assert made["masks/b/a9.png"] == made["masks/c.png"]


def test_the_disk_is_asked_once_for_an_archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make_images(tmp_path / "in", [f"{index}.png" for index in range(50)])
    archive = packed(tmp_path / "in", tmp_path / "all.tar", sorted(os.listdir(tmp_path / "in")))
    asked: list[object] = []

    def counting(real):
        def call(path, *arguments, **options):
            if str(path) == str(archive):
                asked.append(path)
            return real(path, *arguments, **options)

        return call

    for name in ("stat", "lstat"):
        monkeypatch.setattr(os, name, counting(getattr(os, name)))
    assert len(make_plan([str(archive)], str(tmp_path / "out"), products=Products(pack=True)).jobs) == 50
    assert len(asked) < 10, "however many members it has"


def test_messages_name_the_member_not_the_archive_alone(images: Path, tmp_path: Path, ffseg_command: Command) -> None:
    (images / "a.png").write_text("no image")
    archive = packed(images, tmp_path / "all.tar")
    done = ffseg_command("run", archive, "--out", tmp_path / "out", "-v")
    assert f"ffseg: {archive}/a.png: not-an-image: " in done.stderr
    assert f"{archive}/b/a9.png" in done.stderr
    plan = ffseg_command("run", archive, "--out", tmp_path / "new", "--dry-run", "--json")
    assert [(row["image"], row["path"]) for row in json.loads(plan.stdout)["images"]] == [
        (name, f"{archive}/{name}") for name in sorted(NAMES, key=natural_key)
    ]
    twice = ffseg_command("run", archive, images, "--out", tmp_path / "new")
    assert f"{archive}/a.png and {images}/a.png would share the output name a; rename all but one" in twice.stderr


def test_members_stay_inside_the_output_folder(images: Path, tmp_path: Path) -> None:
    data = (images / "a.png").read_bytes()
    with tarfile.open(tmp_path / "bad.tar", "w") as archive:
        for name in ("../out.png", "/etc/out.png", "a/../../out.png", "plain.png", "notes.txt", ".hidden.png"):
            member = tarfile.TarInfo(name)
            member.size = len(data)
            archive.addfile(member, io.BytesIO(data))
        link = tarfile.TarInfo("link.png")
        link.type, link.linkname = tarfile.SYMTYPE, "/etc/passwd"
        archive.addfile(link)
    run_batch(tmp_path / "bad.tar", tmp_path / "deep" / "out", executor=INPROCESS)
    rows = {row["image"]: row["error"][:8] for row in table(tmp_path / "deep" / "out" / "timings.csv")}
    assert sorted(rows.values()) == ["", "bad-name", "bad-name", "bad-name", "missing:"], "the link leads out: named"
    assert rows["plain.png"] == ""
    assert not (list(tmp_path.rglob("out.png")))
    assert not (list(tmp_path.glob("deep/*.png")))


def _second_header(data: bytearray) -> int:
    return data.index(b"./b/a10.png")


DAMAGE = {
    "cut in a header": lambda data: data[: _second_header(data) + 300],
    "cut in a member": lambda data: data[: _second_header(data) + 520],
    "a changed byte in a header": lambda data: data.replace(b"./b/a10.png", b"./b/a11.png", 1),
    "a header of zeros": lambda d: d.replace(d[_second_header(d) : _second_header(d) + 512], bytes(512), 1),
    "a long tail of zeros": lambda data: data[: _second_header(data)] + bytes(1 << 21),
    "another archive behind it": lambda data: data + data,
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_an_archive_that_is_cut_or_damaged_is_refused(damage, images: Path, tmp_path: Path) -> None:
    """Its images up to the damage were run, the others missed, with exit code 0."""
    archive = tmp_path / "all.tar"
    with tarfile.open(archive, "w", format=tarfile.USTAR_FORMAT) as file:  # headers of one block
        for name in NAMES:
            file.add(images / name, f"./{name}")
    archive.write_bytes(damage(bytearray(archive.read_bytes())))
    said = r"all\.tar cannot be read as an uncompressed tar file \((it is cut or damaged|unexpected end)"
    with pytest.raises(UsageError, match=said):
        discover([str(archive)])


@pytest.mark.parametrize("end", [0, 512, 1024, 10240])
def test_an_archive_may_end_with_its_last_member(end: int, images: Path, tmp_path: Path) -> None:
    archive = packed(images, tmp_path / "all.tar")
    data = archive.read_bytes().rstrip(b"\0")
    archive.write_bytes(data + bytes(-len(data) % 512 + end))
    assert len(discover([str(archive)])) == 3


def test_a_list_that_ends_with_nul_asks_for_its_option(tmp_path: Path) -> None:
    (tmp_path / "list").write_bytes(b"a.png\0b.png\0")
    with pytest.raises(UsageError, match="list holds NUL bytes, which no path does; add -0"):
        sources_of_list(str(tmp_path / "list"))


def test_archives_that_cannot_be_read_in_place_are_refused(images: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is compressed"):
        discover([str(packed(images, tmp_path / "all.tar.gz", mode="w:gz"))])
    (tmp_path / "text.tar").write_text("no archive" * 100)
    with pytest.raises(UsageError, match="cannot be read as an uncompressed tar file"):
        discover([str(tmp_path / "text.tar")])
    archive = packed(images, tmp_path / "cut.tar")
    (source,) = [source for source in discover([str(archive)]) if source.name == "b/a9.png"]
    os.truncate(archive, source.span[0] + 10)
    with pytest.raises(ImageReadError, match="ends before") as caught:
        read_input(source.path, 1 << 20, source.span)
    assert caught.value.reason == "truncated"
    with pytest.raises(ImageReadError, match="limit"):
        read_input(source.path, 10, source.span)


@pytest.mark.parametrize("nul", [False, True])
def test_lists_name_images_one_by_one(nul: bool, images: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(images)
    end = b"\0" if nul else b"\n"
    (tmp_path / "list").write_bytes(end.join([b"b/a9.png", b"a.png", b"a.png", b"b/none.png"]) + end)
    sources = sources_of_list(str(tmp_path / "list"), nul=nul)
    assert [source.name for source in sources] == ["b/a9.png", "a.png", "b/none.png"]
    plan = make_plan(sources, str(tmp_path / "out"))
    assert [job.source.name for job in plan.jobs] == ["b/a9.png", "a.png", "b/none.png"]
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO((tmp_path / "list").read_bytes())))
    assert sources_of_list("-", nul=nul) == sources
    (tmp_path / "list").write_bytes(end.join(os.fsencode(images / name) for name in NAMES))
    assert [source.name for source in sources_of_list(str(tmp_path / "list"), nul=nul)] == NAMES
    (tmp_path / "list").write_bytes(end)
    with pytest.raises(UsageError, match="names no image"):
        sources_of_list(str(tmp_path / "list"), nul=nul)


def test_the_command_takes_a_list_from_stdin(images: Path, tmp_path: Path, ffseg_command: Command) -> None:
    names = "".join(f"{name}\n" for name in NAMES)
    done = ffseg_command("run", "--list", "-", "--out", tmp_path / "out", "--dry-run", cwd=images, input=names, code=0)
    assert [line.split(" -> ")[0] for line in done.stdout.splitlines()] == NAMES
    assert done.stdout.splitlines()[0] == f"{NAMES[0]} -> masks/{NAMES[0][:-4]}.png, contours/{NAMES[0][:-4]}.svg"


@pytest.fixture
def store(images: Path):
    fsspec = pytest.importorskip("fsspec")
    system = fsspec.filesystem("memory")
    for name in NAMES:
        system.pipe(f"/bucket/set/{name}", (images / name).read_bytes())
    system.pipe("/bucket/set/notes.txt", b"text")
    for hidden in (".a.png", ".b/a.png", "d/masks/a.png", "d/.ffseg/runs.jsonl", "e/.ffseg-skip", "e/a.png"):
        system.pipe(f"/bucket/set/{hidden}", (images / "a.png").read_bytes())
    yield system
    system.rm("/bucket", recursive=True)


def test_images_behind_a_url_are_run_like_files(store, images: Path, tmp_path: Path) -> None:
    run_batch(images, tmp_path / "one", executor=INPROCESS)
    plan = make_plan(["memory://bucket/set"], str(tmp_path / "out"))
    assert [job.source.name for job in plan.jobs] == ["a.png", "b/a9.png", "b/a10.png"]
    assert [source.name for source in discover(["memory://bucket/set/b/*.png"])] == ["a9.png", "a10.png"]
    assert [source.name for source in discover(["memory://bucket/set/a.png"])] == ["a.png"]
    store.pipe("/bucket/set/f/a[1].png", (images / "a.png").read_bytes())
    assert [source.name for source in discover(["MEMORY://bucket/set/f/a[1].png"])] == ["a[1].png"]
    labelme = Products(exports=("labelme",))
    run_batch(["memory://bucket/set/a.png"], tmp_path / "three", executor=INPROCESS, products=labelme)
    assert '"memory://bucket/set/a.png"' in (tmp_path / "three" / "labelme" / "a.json").read_text()
    again = partial(run_plan, plan, Setup(params=load_params(), segmenter=stand_in.NAME), executor=INPROCESS)
    assert (again().done, snapshot(tmp_path / "out")) == (3, snapshot(tmp_path / "one"))
    assert again().unchanged == 3
    store.pipe("/bucket/set/a.png", (images / "b" / "a9.png").read_bytes())
    store.rm("/bucket/set/b/a9.png")
    summary = again()
    assert (summary.done, summary.unchanged, summary.failed) == (1, 1, 1)


def test_addresses_of_other_kinds_are_no_inputs() -> None:
    with pytest.raises(UsageError, match="no file or folder ftp"):
        discover(["ftp://somewhere/a.png"])
