"""``ffseg segment``: one image, formats by suffix, pipes."""

import base64
import io
import json
import os
import re
import stat
import subprocess
import sys
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import cv2
import numpy as np
import pytest
from bad_images import READS_GIF
from commands import Command
from PIL import Image

import ffseg
from tests.masks import read_mask, write_image

TOY = Path(__file__).resolve().parents[2] / "samples" / "toy.png"


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture(scope="module")
def mask() -> np.ndarray:
    return ffseg.segment(ffseg.read_image(TOY)).mask


def test_suffixes_say_what_is_written(mask: np.ndarray, tmp_path: Path, ffseg_command: Command) -> None:
    names = ("a.png", "a.svg", "a.geojson", "a.json", "a.jpg", "a.webp")
    done = ffseg_command("segment", TOY, *names, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "")
    said = rf"ffseg: {mask.sum()} px inside, 1 region, 4 holes; converged after \d+ iterations\n"
    assert re.fullmatch(said, done.stderr)
    assert sorted(os.listdir(tmp_path)) == sorted(names)
    assert np.array_equal(read_mask(tmp_path / "a.png"), mask)
    assert "<title>toy.png</title>" in (tmp_path / "a.svg").read_text("utf-8")
    assert json.loads((tmp_path / "a.geojson").read_text())["features"][0]["properties"]["holes"] == 4
    assert json.loads((tmp_path / "a.json").read_text())["images"][0]["file_name"] == "toy.png"
    assert ffseg.read_image(tmp_path / "a.jpg").shape == ffseg.read_image(tmp_path / "a.webp").shape == (600, 800, 3)


def test_a_pattern_is_said_to_be_one(tmp_path: Path, ffseg_command: Command) -> None:
    done = ffseg_command("segment", "*.png", "a.svg", cwd=tmp_path, code=3)
    said = "*.png: there is no such file, or its link points nowhere; 'ffseg run' takes patterns\n"
    assert done.stderr.endswith(said)


def test_domains_by_name_are_those_of_run_and_never_passed_over(tmp_path: Path, ffseg_command: Command) -> None:
    write_image(tmp_path / "own" / "toy.png", np.indices((600, 800))[1] < 500)
    own = ("--set", "domain.masks=own")
    done = ffseg_command("segment", TOY, "a.png", *own, cwd=tmp_path)
    assert ffseg_command("run", TOY, "--out", "out", *own, cwd=tmp_path).returncode == done.returncode == 0
    found = read_mask(tmp_path / "a.png")
    assert np.array_equal(found, read_mask(tmp_path / "out" / "masks" / "toy.png"))
    assert not found[:, 501:].any()
    for command in (("segment", "-", "b.png"), ("run", "-", "--raw", "8x8:gray", "--out", "-")):
        refused = ffseg_command(*command, *own, cwd=tmp_path)
        assert (refused.returncode, "domain.masks finds masks by the names" in refused.stderr) == (2, True)
    with pytest.raises(ffseg.ParameterError, match=r"domain\.masks finds masks by the names of files"):
        ffseg.segment(ffseg.read_image(TOY), {"domain.masks": str(tmp_path / "own")})


def test_outputs_are_written_together_or_not_at_all(tmp_path: Path, ffseg_command: Command) -> None:
    done = ffseg_command("segment", TOY, "a.png", "none/a.svg", "a.json", cwd=tmp_path)
    assert (done.returncode, os.listdir(tmp_path)) == (3, [])
    assert "none/a.svg cannot be written" in done.stderr


def test_the_class_that_labels_of_yolo_cannot_name_is_said(tmp_path: Path, ffseg_command: Command) -> None:
    done = ffseg_command("segment", TOY, "a.txt", "--label", "road", cwd=tmp_path)
    assert done.stderr.startswith("ffseg: class 0 of YOLO's labels is road: name it in the data set's YAML file\n")
    assert (tmp_path / "a.txt").read_text().startswith("0 0.")


def test_an_address_is_read_as_run_reads_it(mask: np.ndarray, tmp_path: Path, ffseg_command: Command) -> None:
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=os.fspath(TOY.parent))) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        address = f"http://127.0.0.1:{server.server_port}"
        done = ffseg_command("segment", f"{address}/toy.png?size=all", "a.png", "a.svg", cwd=tmp_path)
        gone = ffseg_command("segment", f"{address}/none.png", "b.png", cwd=tmp_path)
        server.shutdown()
        thread.join()
    assert done.returncode == 0, done.stderr
    assert np.array_equal(read_mask(tmp_path / "a.png"), mask)
    assert "<title>toy.png</title>" in (tmp_path / "a.svg").read_text("utf-8")
    assert (gone.returncode, gone.stderr) == (3, f"ffseg: error: {address}/none.png: there is no such object\n")


@pytest.mark.parametrize("kind", [None, "svg", "geojson", "coco", "labelme", "overlay"])
def test_pipes(kind: str | None, mask: np.ndarray, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "ffseg", "segment", "-", "-", "-q", *(["--as", kind] if kind else [])]
    done = subprocess.run(command, input=TOY.read_bytes(), capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    if kind is None:
        assert np.array_equal(np.asarray(Image.open(io.BytesIO(done.stdout))) == 255, mask)
    elif kind == "overlay":
        assert Image.open(io.BytesIO(done.stdout)).size == (800, 600)
    else:
        assert done.stdout.startswith(b"<?xml" if kind == "svg" else b"{")


def test_labelme_finds_the_image_from_where_the_document_is(tmp_path: Path, ffseg_command: Command) -> None:
    """Only its name was told, as if it lay beside."""
    ffseg_command("segment", TOY, tmp_path / "a.json", "--as", "labelme", code=0)
    told = json.loads((tmp_path / "a.json").read_text())
    assert ((tmp_path / told["imagePath"]).resolve(), told["imageData"]) == (TOY.resolve(), None)
    command = [sys.executable, "-m", "ffseg", "segment", "-", "-", "-q", "--as", "labelme"]
    told = json.loads(subprocess.run(command, input=TOY.read_bytes(), capture_output=True, check=True).stdout)
    assert Image.open(io.BytesIO(base64.b64decode(told["imageData"]))).size == (800, 600)


def test_it_finds_what_run_finds(tmp_path: Path, ffseg_command: Command) -> None:
    setting = ["--set", "contour.degree=2", "--set", "init.center=[390,300]"]
    ffseg_command("run", TOY, "--out", tmp_path / "run", *setting, code=0)
    ffseg_command("segment", TOY, tmp_path / "a.png", tmp_path / "a.svg", *setting, code=0)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "run" / "masks" / "toy.png").read_bytes()
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "run" / "contours" / "toy.svg").read_bytes()


USAGE = {
    "unknown suffix": (["{toy}", "a.tif"], "the suffix .tif stands for no output"),
    "no suffix": (["{toy}", "a"], "a: there is no suffix"),
    "one mask twice": (["{toy}", "a.png", "b.PNG"], "a.png and b.PNG would be the same mask"),
    "one pipe twice": (["{toy}", "-", "-"], "takes one image, 'ffseg run' many"),
    "unknown kind": (["{toy}", "a.png", "--as", "geojsn"], "did you mean 'geojson'?"),
    "over the input": (["{toy}", "{toy}"], "would replace the input image"),
    "wrong parameter": (["{toy}", "a.png", "--set", "contour.degre=2"], "did you mean 'contour.degree'?"),
    "no output": (["{toy}"], "OUT"),
}


@pytest.mark.parametrize(("arguments", "said"), USAGE.values(), ids=USAGE)
def test_usage_errors(arguments: list[str], said: str, tmp_path: Path, ffseg_command: Command) -> None:
    (tmp_path / "toy.png").write_bytes(TOY.read_bytes())
    done = ffseg_command("segment", *(text.format(toy="toy.png") for text in arguments), cwd=tmp_path, code=2)
    assert said in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["toy.png"]
    assert (tmp_path / "toy.png").read_bytes() == TOY.read_bytes()


@pytest.mark.parametrize("length", [None, 600], ids=["whole", "cut"])
@pytest.mark.parametrize(("out", "kind"), [("b.png", []), ("b.jpg", []), ("b.png", ["--as", "svg"])])
def test_photos_are_kept(out: str, kind: list[str], length: int | None, tmp_path: Path, ffseg_command: Command) -> None:
    """`ffseg segment *.png` in a folder of two must not turn the second photograph into a mask of the first."""
    photo = np.random.default_rng(0).integers(0, 256, (30, 40, 3), np.uint8)
    Image.fromarray(photo).save(tmp_path / out)
    (tmp_path / out).write_bytes((tmp_path / out).read_bytes()[:length])
    before = (tmp_path / out).read_bytes()
    done = ffseg_command("segment", TOY, out, *kind, cwd=tmp_path)
    said = f"ffseg: error: {out} is there already and not known as a file of ffseg; choose another name or add --overwrite\n"
    assert (done.returncode, done.stderr) == (2, said)
    assert (tmp_path / out).read_bytes() == before
    ffseg_command("segment", TOY, out, *kind, "--overwrite", cwd=tmp_path, code=0)
    assert (tmp_path / out).read_bytes() != before


@pytest.mark.parametrize(
    ("name", "kind", "foreign"),
    [
        ("a.png", "mask", "no picture"),
        ("a.svg", "svg", '<svg xmlns="http://www.w3.org/2000/svg"/>'),
        ("a.json", "coco", '{"info": {}, "images": []}'),
        ("a.json", "labelme", '{"version": "5.4.1", "flags": {}, "shapes": []}'),
        ("a.geojson", "geojson", '{"type": "FeatureCollection", "features": []}'),
        ("a.txt", "yolo", "0 0.5 0.5 0.25 0.25"),
    ],
)
def test_own_files_are_replaced(name: str, kind: str, foreign: str, tmp_path: Path, ffseg_command: Command) -> None:
    (tmp_path / name).write_bytes(b"")
    for image in (TOY, TOY.with_name("simple.png")):
        ffseg_command("segment", image, name, "--as", kind, cwd=tmp_path, code=0)
    own = (tmp_path / name).read_bytes()
    ffseg_command("segment", TOY.with_name("simple.png"), "new", "--as", kind, cwd=tmp_path, code=0)
    assert own == (tmp_path / "new").read_bytes()
    (tmp_path / name).write_text(foreign)
    done = ffseg_command("segment", TOY, name, "--as", kind, cwd=tmp_path, code=2)
    assert f"{name} is there already and not known as a file of ffseg" in done.stderr
    assert (tmp_path / name).read_text() == foreign


@pytest.mark.skipif(not READS_GIF, reason="this OpenCV reads no GIF")
def test_frames_that_are_not_read_are_told(tmp_path: Path, ffseg_command: Command) -> None:
    frames = [Image.new("L", (40, 30), level) for level in (60, 200)]
    frames[0].save(tmp_path / "film.gif", save_all=True, append_images=frames[1:])
    done = ffseg_command("segment", "film.gif", "a.png", "--set", "init.radius=5", cwd=tmp_path, code=0)
    assert done.stderr.startswith(
        "ffseg: only the first frame was read; the GIF file has more: ffseg run --film takes all\n"
    )


@pytest.mark.parametrize("error", [MemoryError(), cv2.error("no memory")], ids=["Python", "OpenCV"])
def test_want_of_memory_is_no_defect(error: Exception, tmp_path: Path, monkeypatch, ffseg_command: Command) -> None:
    def starved(*_: object, **__: object) -> None:
        raise error

    if isinstance(error, cv2.error):
        error.code = cv2.Error.StsNoMem
    monkeypatch.setattr("ffseg.api.segment", starved)
    done = ffseg_command("segment", TOY, "a.png", cwd=tmp_path, code=3)
    assert done.stderr == "ffseg: error: there is not enough memory for the image; scale it down\n"


def test_pipes_and_devices_stay_what_they_are(tmp_path: Path, ffseg_command: Command) -> None:
    os.mkfifo(tmp_path / "a.png")
    done = ffseg_command("segment", TOY, "a.png", cwd=tmp_path)
    assert (done.returncode, "a.png is a named pipe and is not replaced" in done.stderr) == (3, True)
    assert stat.S_ISFIFO((tmp_path / "a.png").stat().st_mode)
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


FAILED = {
    "no image": ("segment nowhere.png a.png", "nowhere.png"),
    "an empty pipe": ("segment - a.png < /dev/null", "stdin is empty"),
    "text": ("segment - a.png <<< hello", "looks like a text file"),
    "a full disk": (f"segment {TOY} - > /dev/full", "stdout cannot be written (No space left on device)"),
    "a start on an edge": (f"segment {TOY} a.png --set 'init.circles=[[-9,-9,2]]'", "outside the image"),
}


@pytest.mark.parametrize(("arguments", "said"), FAILED.values(), ids=FAILED)
def test_what_fails_ends_with_3(arguments: str, said: str, tmp_path: Path) -> None:
    command = ["bash", "-c", f"{sys.executable} -m ffseg {arguments}"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 3
    assert said in done.stderr
    assert list(tmp_path.iterdir()) == []
