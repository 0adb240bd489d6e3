"""Frames through pipes: Y4M and raw pixels in, masks and pictures out, as between two ffmpeg."""

import io
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from drawn_films import pictures
from PIL import Image

import ffseg
from ffseg.io.images import Limits
from ffseg.io.pipes import frames, read_frame_format

COMMAND = [sys.executable, "-m", "ffseg", "run", "-", "--out", "-"]
FRAMES = pictures(4)
HEIGHT, WIDTH = FRAMES[0].shape[:2]
BGR = ("--raw", f"{WIDTH}x{HEIGHT}:bgr24")


def raw(frames: list[np.ndarray]) -> bytes:
    return b"".join(pixels[:, :, ::-1].tobytes() for pixels in frames)


RAW = raw(FRAMES)


def y4m(frames: list[np.ndarray], colours: str = "420jpeg") -> bytes:
    """A stream as ffmpeg writes it: BT.601, studio range."""
    height, width = frames[0].shape[:2]
    data = b"YUV4MPEG2 W%d H%d F30000:1001 Ip A1:1 C%s XYSCSS=420JPEG\n" % (width, height, colours.encode())
    for pixels in frames:
        r, g, b = (pixels[:, :, k].astype(float) for k in range(3))
        y = 16 + (65.738 * r + 129.057 * g + 25.064 * b) / 256
        u = 128 + (-37.945 * r - 74.494 * g + 112.439 * b) / 256
        v = 128 + (112.439 * r - 94.154 * g - 18.285 * b) / 256
        halves = (plane.reshape(height // 2, 2, width // 2, 2).mean((1, 3)) for plane in (u, v))
        planes = (np.rint(plane).clip(0, 255).astype(np.uint8) for plane in (y, *halves))
        data += b"FRAME\n" + b"".join(plane.tobytes() for plane in planes)
    return data


def through(data: bytes, *options: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run([*COMMAND, *options], input=data, capture_output=True, check=False)


def masks(data: bytes) -> np.ndarray:
    return np.frombuffer(data, np.uint8).reshape(-1, HEIGHT, WIDTH)


def own_mask(pixels: np.ndarray, init: dict[str, object] | None = None) -> np.ndarray:
    return ffseg.segment(np.ascontiguousarray(pixels[:, :, ::-1]), init).mask


def test_raw_frames_give_the_masks_of_the_images() -> None:
    done = through(RAW, *BGR, "-q")
    assert (done.returncode, done.stderr) == (0, b"")
    for found, pixels in zip(masks(done.stdout), FRAMES, strict=True):
        assert ((found > 0) == own_mask(pixels)).all()


def test_y4m_goes_in_and_out_with_its_rate() -> None:
    done = through(y4m(FRAMES))
    assert done.returncode == 0
    head, *parts = done.stdout.split(b"FRAME\n")
    assert head == b"YUV4MPEG2 W80 H60 F30000:1001 Ip A1:1 Cmono\n"
    plain = masks(through(RAW, *BGR).stdout)
    for part, mask in zip(parts, plain, strict=True):
        found = np.frombuffer(part, np.uint8).reshape(HEIGHT, WIDTH)
        assert set(np.unique(found)) == {0, 255}
        assert np.mean(found != mask) < 0.02  # colours of two pixels are stored as one
    assert b"4 frames, " in done.stderr


def test_y4m_of_full_range_has_the_values_of_a_jpeg_file() -> None:
    planes = [np.array([[76, 76, 0, 64], [76, 76, 192, 255]]), np.array([[85, 128]]), np.array([[255, 128]])]
    data = b"YUV4MPEG2 W4 H2 F25:1 C420jpeg XCOLORRANGE=FULL\nFRAME\n"
    stream = io.BytesIO(data + b"".join(plane.astype(np.uint8).tobytes() for plane in planes))
    (found,) = frames(stream, read_frame_format(stream, "", Limits()))
    assert (
        np.abs(found[:, :2].astype(int) - (0, 0, 254)).max() <= 1
    )  # BGR; whole numbers of Y, Cb and Cr miss pure red by one
    assert (found[:, 2:] == [[[0] * 3, [64] * 3], [[192] * 3, [255] * 3]]).all()


def test_pictures_come_back_in_colour() -> None:
    cut = through(y4m(FRAMES), "--film-out", "cutout")
    head, first, *_ = cut.stdout.split(b"FRAME\n")
    assert head.endswith(b"C420jpeg\n")
    assert len(first) == WIDTH * HEIGHT * 3 // 2
    luma = np.frombuffer(first, np.uint8)[: WIDTH * HEIGHT].reshape(HEIGHT, WIDTH)
    assert luma[0, 0] == 16  # black outside
    assert luma[30, 40] > 100
    drawn = through(RAW, *BGR, "--film-out", "overlay").stdout
    assert len(drawn) == len(RAW)
    assert drawn != RAW


@pytest.mark.parametrize(
    ("data", "options", "code", "sentence"),
    [
        (b"", [], 2, "stdin holds no Y4M"),
        (b"\x89PNG....", [], 2, "stdin holds no Y4M; send ffmpeg -f yuv4mpegpipe"),
        (y4m(FRAMES, "420p10"), [], 2, "colours 420p10; send 8 bits"),
        (b"YUV4MPEG2 W80 F25:1\n", [], 2, "has no size"),
        (b"YUV4MPEG2 W81 H60\n", [], 2, "81x60 is odd"),
        (b"YUV4MPEG2 W80 H60\nWRONG\n", [], 3, "no frame begins where frame 0 should"),
        (b"YUV4MPEG2 W99999 H99999\n", [], 2, "send another size"),
        (y4m(FRAMES, "420jpeg"), ["--raw", "80x60:bgr24"], 3, "stdin holds Y4M, which says its size itself"),
        (RAW[:-7], ["--raw", "80x60:bgr24"], 3, "stdin ends inside frame 3"),
        (RAW, ["--raw", "80x60"], 2, "--raw 80x60: write WIDTHxHEIGHT:LAYOUT"),
        (RAW, ["--raw", "80x60:bgr24", "--camera", "c.yaml"], 2, "frames of a pipe take no --camera"),
        (RAW, ["--raw", "80x60:bgr24", "--film-out", "mask,overlay"], 2, "a pipe takes one of mask, overlay, cutout"),
    ],
)
def test_streams_that_cannot_be_read_are_named(data: bytes, options: list[str], code: int, sentence: str) -> None:
    done = through(data, *options)
    assert (done.returncode, sentence in done.stderr.decode()) == (code, True), done.stderr


def test_frames_before_the_break_are_sent() -> None:
    done = through(RAW[:-7], *BGR)
    assert len(masks(done.stdout)) == 3


def test_a_frame_that_fails_keeps_its_place() -> None:
    done = through(RAW, *BGR, "--set", "init.center=[500,500]")
    assert done.returncode == 3
    assert not masks(done.stdout).any()
    assert len(masks(done.stdout)) == 4
    assert b"4 failed" in done.stderr


def test_starts_are_found_by_the_number_of_a_frame(tmp_path: Path) -> None:
    path = tmp_path / "starts.csv"
    path.write_text("image,x,y,radius\nfilm_000002.mp4,8,8,4\n1,40,30,6\n99,1,1,1\n", encoding="utf-8")
    found = masks(through(RAW, *BGR, "--starts", str(path)).stdout) > 0
    starts = ({}, {"init.center": [40, 30], "init.radius": 6}, {"init.center": [8, 8], "init.radius": 4})
    for mask, pixels, init in zip(found, FRAMES, starts, strict=False):
        assert (mask == own_mask(pixels, init)).all()
    assert not found[2, 30, 40], "it starts on the ground, not on the disc"


@pytest.mark.parametrize(
    ("rows", "sentence"),
    [
        ("a.png,1,2,3\n", "starts.csv:2: 'a.png' has no number at its end; call frames 0, 1, 2"),
        ("1,1,2,3\nf_001.png,1,2,3\n", "starts.csv:3: 'f_001.png' is called so already"),
    ],
)
def test_starts_that_name_no_frame_are_refused(tmp_path: Path, rows: str, sentence: str) -> None:
    starts = tmp_path / "starts.csv"
    starts.write_text(f"image,x,y,radius\n{rows}", encoding="utf-8")
    done = through(RAW, *BGR, "--starts", str(starts))
    assert (done.returncode, done.stdout, sentence in done.stderr.decode()) == (2, b"", True), done.stderr


def test_steady_frames_of_a_pipe_are_those_of_a_film(tmp_path: Path) -> None:
    noisy = pictures(5, noise=35)
    for number, pixels in enumerate(noisy):
        Image.fromarray(pixels).save(tmp_path / f"f_{number:06d}.png")
    starts = tmp_path / "starts.csv"
    starts.write_text("image,x,y,radius\nf_000000.png,36,30,5\nf_000000.png,46,30,5\n")  # what follows holds them
    run = [sys.executable, "-m", "ffseg", "run", str(tmp_path), "--out", str(tmp_path / "out"), "--steady", "-q"]
    assert subprocess.run([*run, "--starts", str(starts)], check=False).returncode == 0
    steady, plain = (
        masks(through(raw(noisy), *BGR, *more).stdout) for more in (["--steady", "--starts", str(starts)], [])
    )
    for number, mask in enumerate(steady):
        assert (np.asarray(Image.open(tmp_path / "out" / "masks" / f"f_{number:06d}.png")) == mask).all()
    assert (steady != plain).any()


def test_a_pipe_has_two_ends() -> None:
    done = subprocess.run([*COMMAND[:-1], "folder"], input=RAW, capture_output=True, check=False)
    assert (done.returncode, b"ffseg run - --out -" in done.stderr) == (2, True)


def test_raw_pixels_are_those_of_a_pipe() -> None:
    command = [*COMMAND[:-3], "folder", "--out", "out", "--raw", "8x6:gray"]
    done = subprocess.run(command, capture_output=True, check=False)
    assert (done.returncode, b"--raw says what stdin holds" in done.stderr) == (2, True)


def test_it_ends_when_nobody_reads() -> None:
    """Heard of at the next frame that is written, however many are still to come."""
    code = "import sys; sys.stdin.buffer.read(10)"
    with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE) as reader:
        streams = {"stdout": reader.stdin, "stderr": subprocess.PIPE}
        done = subprocess.run([*COMMAND, *BGR], input=RAW * 25, check=False, **streams)
    assert done.returncode == 3
    assert b"whoever reads stdout has gone" in done.stderr
