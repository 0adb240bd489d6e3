"""Films as inputs: every frame is an image with its time, whatever the container, and damage costs what it damaged."""

import importlib.util
import struct
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
import tifffile
from batches import Silent, run_batch, snapshot, table
from commands import Command
from drawn_films import pictures, write_animation, write_film
from PIL import Image

from ffseg.batch.outputs.table import Products
from ffseg.batch.plan.discover import discover
from ffseg.batch.plan.jobs import make_plan
from ffseg.batch.plan.reading import read_input, split_member_path
from ffseg.batch.workers.pictures import read_source
from ffseg.errors import ImageReadError, UsageError
from ffseg.io.containers import is_cut
from ffseg.io.films import film_contents
from ffseg.io.images import read_image

INPROCESS = "inprocess"
CODECS = {
    "a.mp4": "libx264", "a.mkv": "libx264", "a.avi": "libx264", "b.avi": "mpeg4", "a.mov": "mjpeg",
    "a.webm": "libvpx", "b.webm": "libvpx-vp9",
}  # fmt: skip
"""Codecs with frames stored in another order than shown (AVI even without their times), and with frames never shown."""
NEWER_AV = pytest.mark.skipif(int(av.__version__.partition(".")[0]) < 18, reason="an older PyAV makes no such film")


@pytest.fixture
def film(tmp_path: Path) -> Path:
    return write_film(tmp_path / "film.mp4", pictures(12))


@pytest.mark.parametrize("name", CODECS)
def test_every_frame_is_read_in_the_order_shown(tmp_path: Path, name: str) -> None:
    frames = pictures(12)
    options = {"auto-alt-ref": "1", "lag-in-frames": "10"} if CODECS[name] == "libvpx" else None
    sources = discover([str(write_film(tmp_path / name, frames, CODECS[name], options=options))])
    stem, suffix = name.split(".")
    assert [source.name for source in sources] == [f"{stem}_{number:06d}.{suffix}" for number in range(12)]
    assert [source.time for source in sources] == pytest.approx([number / 25 for number in range(12)], abs=2e-3)
    for source, pixels in zip(sources, frames, strict=True):
        off = np.abs(read_source(source).astype(int) - pixels[:, :, ::-1]).mean()
        others = [np.abs(read_source(source).astype(int) - other[:, :, ::-1]).mean() for other in frames[:3]]
        assert off < 12
        assert off <= min(others) + 0.1


@pytest.mark.parametrize("name", ["a.gif", "a.webp", "a.png", "a.tiff"])
def test_animations_and_pages_are_films_where_asked(tmp_path: Path, name: str) -> None:
    frames = pictures(5)
    path = str(write_animation(tmp_path / name, frames))
    (still,) = discover([path])
    assert still.name == name
    sources = discover([path], film=True)
    times = [None] * 5 if name == "a.tiff" else pytest.approx([0, 0.04, 0.08, 0.12, 0.16])
    assert [source.time for source in sources] == times
    for source, pixels in zip(sources, frames, strict=True):
        assert np.abs(read_source(source).astype(int) - pixels[:, :, ::-1]).max() <= 8  # a GIF has 256 colours
    single = write_animation(tmp_path / f"single{Path(name).suffix}", frames[:1])
    assert [source.span for source in discover([str(single)], film=True)] == [None]


@pytest.mark.parametrize("orientation", [1, 3, 6])
@pytest.mark.parametrize("name", ["a.webp", "a.png", "a.tiff"])
def test_frames_and_pages_stand_as_the_image_that_is_their_first(name: str, orientation: int, tmp_path: Path) -> None:
    path, exif = tmp_path / name, Image.Exif()
    exif[0x112] = orientation
    first, *others = (Image.fromarray(picture) for picture in pictures(2))
    more = {"tiffinfo": {0x112: orientation}} if name == "a.tiff" else {"exif": exif, "lossless": True}
    first.save(path, save_all=True, append_images=others, **more)
    frames = [read_source(one) for one in discover([str(path)], film=True)]
    assert np.array_equal(frames[0], read_image(path))
    assert (len(frames), frames[1].shape) == (2, frames[0].shape)


@pytest.mark.parametrize(("kind", "photometric"), [("i1", "minisblack"), ("i2", "minisblack"), ("u2", "miniswhite")])
def test_pages_that_would_be_read_with_other_values_are_refused(kind: str, photometric: str, tmp_path: Path) -> None:
    """Bytes with a sign came as 196 for -60, and two bytes a pixel that begin with white upside down."""
    page = np.arange(-60, 60, dtype=np.int64).reshape(10, 12).astype(kind)
    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        for _ in range(2):
            file.write(page, photometric=photometric)
    one = discover([str(tmp_path / "a.tif")], film=True)[0]
    with pytest.raises(ImageReadError) as caught:
        read_source(one)
    assert caught.value.reason == "unsupported-pixels"


def test_a_frame_is_one_text_and_is_read_from_anywhere(film: Path) -> None:
    sources = discover([str(film)])
    assert split_member_path(sources[3].content) == (str(film), "film_000003.mp4", (3, 1))
    data = [read_input(source.content, 1 << 20) for source in sources]
    assert len(set(data)) == 12
    for number in (7, 2, 2, 11):
        assert read_input(sources[number].content, 1 << 20) == data[number]


def test_rows_have_times_and_a_stopped_run_goes_on_inside_the_film(film: Path, tmp_path: Path) -> None:
    straight, out = tmp_path / "straight", tmp_path / "out"
    assert run_batch(film, straight, executor=INPROCESS).done == 12
    times = [row["time_s"] for row in table(straight / "timings.csv")]
    assert times[:3] == ["0.0", "0.04", "0.08"]
    assert run_batch(film, out, executor=INPROCESS, observer=Silent(last=5)).done == 5
    after = run_batch(film, out, executor=INPROCESS)
    assert (after.done, after.unchanged) == (7, 5)
    assert (snapshot(out), [row["time_s"] for row in table(out / "timings.csv")]) == (snapshot(straight), times)


def test_a_film_that_changed_is_done_again_where_its_frames_did(film: Path, tmp_path: Path) -> None:
    run_batch(film, tmp_path / "out", executor=INPROCESS)
    write_film(film, [*pictures(6), *(255 - pixels for pixels in pictures(6))])
    again = run_batch(film, tmp_path / "out", executor=INPROCESS)
    assert again.failed == 0
    assert again.done >= 6


def cut(path: Path, part: float) -> Path:
    data = path.read_bytes()
    short = path.with_name(f"cut{path.suffix}")
    short.write_bytes(data[: int(len(data) * part)])
    return short


@pytest.mark.parametrize("part", [0.85, 0.985])
@pytest.mark.parametrize("name", CODECS)
def test_a_film_that_was_cut_says_so_behind_its_last_frame(tmp_path: Path, name: str, part: float) -> None:
    film = write_film(tmp_path / name, pictures(40, noise=20), CODECS[name])
    *frames, last = discover([str(cut(film, part))])
    assert 5 < len(frames) <= 40
    assert last.problem.startswith(f"truncated: the film ends after {len(frames)} frames, before its head says; copy")
    read_source(frames[0])


@pytest.mark.parametrize("rest", [b"\x18\x53", b"\x18\x53\x80\x67", b"\x18\x53\x80\x67\x01\0\0"])
def test_a_film_that_ends_in_the_head_of_an_element_is_cut(rest: bytes, tmp_path: Path) -> None:
    """In its name, before its length, and in that, of which no other number must be made."""
    path = tmp_path / "a.mkv"
    for more, cut_off in ((b"", False), (rest, True), (b"\0", False)):
        path.write_bytes(b"\x1a\x45\xdf\xa3\x81\0" + more)
        assert is_cut(str(path)) is cut_off


@pytest.mark.parametrize("left", [0, 3, 30])
@pytest.mark.parametrize(("name", "options", "mark"), [
    ("a.mkv", {"live": "1"}, b"\xa3"), ("a.mp4", {"movflags": "frag_every_frame+empty_moov"}, b"mdat"),
])  # fmt: skip
def test_a_film_recorded_live_is_known_to_be_cut(
    tmp_path: Path, name: str, options: dict, mark: bytes, left: int
) -> None:
    """Its head states neither its length nor how many frames it has: its last part, of a frame, does."""
    film = write_film(tmp_path / name, pictures(40, noise=20), options=options)
    whole = film.read_bytes()
    film.write_bytes(whole[: whole.rindex(mark, 0, -100) + left] if left else whole)
    found = discover([str(film)])
    assert [one.problem.partition(":")[0] for one in found[-2:]] == ["", "truncated" if left else ""]


def test_a_damaged_film_costs_the_frames_it_damaged(tmp_path: Path) -> None:
    path = write_film(tmp_path / "a.mp4", pictures(20, noise=20))
    with av.open(str(path)) as film:
        packet = list(film.demux(video=0))[10]
        place, size = packet.pos, packet.size
    data = bytearray(path.read_bytes())
    data[place : place + size] = bytes(size)
    path.write_bytes(data)
    out = run_batch(path, tmp_path / "out", executor=INPROCESS)
    assert (out.total, out.done) == (20, 20 - out.failed)
    assert 1 <= out.failed <= 2
    for row in table(tmp_path / "out" / "timings.csv"):
        assert row["error"].startswith("damaged: ") == (row["status"] == "failed")
        assert row["time_s"]


@pytest.mark.parametrize("content", [b"", b"no film at all" * 100, b"#EXTM3U\n#EXTINF:1,\n/etc/other.mp4\n"])
def test_what_is_no_film_is_a_row_that_says_so(tmp_path: Path, content: bytes) -> None:
    """Also a list of other files, which a reader of lists would open."""
    path = tmp_path / "a.mp4"
    path.write_bytes(content)
    (source,) = discover([str(path)])
    assert source.problem.startswith("damaged: it is no film that can be read")
    with pytest.raises(ImageReadError):
        film_contents(str(path))


def test_sound_alone_is_no_film(tmp_path: Path) -> None:
    with av.open(str(tmp_path / "a.mkv"), "w") as film:
        track = film.add_stream("pcm_s16le", rate=8000, layout="mono")
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), format="s16", layout="mono")
        frame.sample_rate = 8000
        film.mux(track.encode(frame))
    (source,) = discover([str(tmp_path / "a.mkv")])
    assert source.problem.startswith("not-an-image: the film has no picture track")


def test_a_coding_that_nobody_knows_is_told(film: Path) -> None:
    film.write_bytes(film.read_bytes().replace(b"mp4v", b"zzzz").replace(b"avc1", b"zzzz"))
    (source,) = discover([str(film)])
    assert source.problem.startswith("unsupported-pixels: the film's pictures are coded as nothing that PyAV decodes")


@pytest.mark.parametrize(
    ("suffix", "mark", "broken"),
    [
        (".gif", b"\x21\xf9\x04", b"\x21\xf9\x01\0\0\x21\xf9\x04"),
        (".tif", b"\3\1\3\0\1\0\0\0\1", b"\3\1\3\0\1\0\0\0\xff"),
    ],
)
def test_a_damaged_animation_is_told_whatever_its_parser_raises(
    suffix: str, mark: bytes, broken: bytes, tmp_path: Path
) -> None:
    """Of a control block of one byte `struct.error`, of a compression that nobody knows `KeyError`."""
    path = write_animation(tmp_path / f"a{suffix}", pictures(3))
    before, found, after = path.read_bytes().rpartition(mark)
    assert found
    path.write_bytes(before + broken + after)
    (source,) = discover([str(path)], film=True)
    assert source.problem.startswith("damaged: a frame of it cannot be read")


def test_what_is_said_of_a_damaged_page_names_it(tmp_path: Path) -> None:
    """Pillow logs what it cannot decode, and Python shows on stderr what nobody handles."""
    path = write_animation(tmp_path / "a.tif", pictures(3))
    before, mark, after = path.read_bytes().rpartition(b"\x15\1\3\0\1\0\0\0\3")  # samples a pixel
    path.write_bytes(before + mark[:-1] + b"\xff" + after)
    command = [sys.executable, "-m", "ffseg", "run", path, "--film", "--out", tmp_path / "out", "-q"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, [line for line in done.stderr.splitlines() if "a.tif: damaged" not in line]) == (3, [])


def test_a_film_without_reader_is_refused_by_name(film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    animation = write_animation(tmp_path / "a.gif", pictures(3))
    monkeypatch.setattr("ffseg.plugins.find_spec", lambda _: None)
    with pytest.raises(UsageError, match=r"film.mp4: a film needs PyAV; install it with: pip install 'ffseg\[video\]'"):
        make_plan([str(film)], str(tmp_path / "out"))
    with pytest.raises(UsageError, match=r"a.gif: --film needs Pillow for it; install it with: pip install 'ffseg"):
        make_plan([str(animation)], str(tmp_path / "out"), film=True)
    assert len(make_plan([str(animation)], str(tmp_path / "out")).jobs) == 1
    assert importlib.util.find_spec("av") is not None


def copied(film: Path, begin: float = 0, turn: int = 0) -> Path:
    """The same packets, shown from so many seconds on, or turned by the container."""
    copy = film.with_name("copy.mp4")
    with av.open(str(film)) as source, av.open(str(copy), "w") as made:
        track = made.add_stream_from_template(source.streams.video[0])
        if turn:
            track.set_display_rotation(turn)
        for packet in source.demux(video=0):
            if packet.dts is not None:
                late = round(begin / packet.time_base)
                packet.pts, packet.dts, packet.stream = packet.pts - late, packet.dts - late, track
                made.mux(packet)
    return copy


@NEWER_AV
def test_a_phone_held_upright_gives_upright_frames(tmp_path: Path) -> None:
    """Turned by the container's note, as players do; a quarter turn, either way."""
    turned = copied(write_film(tmp_path / "plain.mp4", pictures(3)), turn=90)
    assert read_source(discover([str(turned)])[0]).shape[:2] == (80, 60)


def test_a_mirrored_film_is_mirrored(tmp_path: Path) -> None:
    """Its note is no turn: x' = -x, y' = y."""
    film = write_film(tmp_path / "a.mp4", [frame[:, :40] for frame in pictures(3)])
    plain, data = read_source(discover([str(film)])[0]), bytearray(film.read_bytes())
    at = data.index(b"tkhd") + 44  # of version 0
    data[at : at + 36] = struct.pack(">9i", -(1 << 16), 0, 0, 0, 1 << 16, 0, 40 << 16, 0, 1 << 30)
    (tmp_path / "b.mp4").write_bytes(data)
    assert np.array_equal(read_source(discover([str(tmp_path / "b.mp4")])[0]), plain[:, ::-1])


def test_a_film_that_starts_late_is_whole(tmp_path: Path) -> None:
    frames = pictures(6)
    with av.open(str(tmp_path / "late.mkv"), "w") as film:
        track = film.add_stream("libx264", rate=25)
        track.width, track.height, track.pix_fmt = 80, 60, "yuv420p"
        for number, pixels in enumerate(frames):
            frame = av.VideoFrame.from_ndarray(pixels, format="rgb24")
            frame.pts, frame.time_base = 25 + number, Fraction(1, 25)
            film.mux(track.encode(frame))
        film.mux(track.encode())
    assert [one.problem for one in discover([str(tmp_path / "late.mkv")])] == [""] * 6


@pytest.mark.parametrize("codec", [pytest.param("libx264", marks=NEWER_AV), "mpeg4"])
def test_a_film_cut_without_coding_it_anew_has_the_frames_that_players_show(tmp_path: Path, codec: str) -> None:
    """Those before the cut, which only the edit list leaves out, are what the first ones are decoded from."""
    part = copied(write_film(tmp_path / "a.mp4", pictures(30, noise=8), codec, options={"g": "30"}), begin=0.4)
    found = discover([str(part)])
    assert ([one.problem for one in found], found[0].time) == ([""] * 20, 0)
    for source, (_time, pixels) in zip(found, played(part), strict=True):
        assert np.array_equal(read_source(source), pixels[:, :, ::-1])


def test_a_cut_animation_costs_itself_alone(tmp_path: Path) -> None:
    cut(write_animation(tmp_path / "a.gif", pictures(6, noise=30)), 0.6)
    (tmp_path / "a.gif").unlink()
    assert run_batch(tmp_path / "cut.gif", tmp_path / "out", executor=INPROCESS, film=True).failed >= 1
    assert "damaged" in (tmp_path / "out" / "timings.csv").read_text()


def test_frames_of_one_time_make_a_film(tmp_path: Path) -> None:
    first, *others = (Image.fromarray(pixels) for pixels in pictures(4))
    first.save(tmp_path / "a.gif", save_all=True, append_images=others, duration=[50, 0, 100, 50])
    run_batch(tmp_path / "a.gif", tmp_path / "out", executor=INPROCESS, products=Products(films=("mask",)), film=True)
    assert len(played(tmp_path / "out" / "a_mask.mp4")) == 4


def test_the_command_takes_films_beside_images(film: Path, tmp_path: Path, ffseg_command: Command) -> None:
    write_animation(tmp_path / "stack.tiff", pictures(3))
    ffseg_command("run", film, tmp_path / "stack.tiff", "--film", "--out", tmp_path / "out", "--jobs", "2", code=0)
    rows = [(row["image"], row["time_s"]) for row in table(tmp_path / "out" / "timings.csv")]
    assert rows[11:] == [("film_000011.mp4", "0.44"), *((f"stack_00000{number}.tiff", "") for number in range(3))]
    assert (tmp_path / "out" / "masks" / "stack_000002.png").is_file()


def played(path: Path) -> list[tuple[float, np.ndarray]]:
    layout = "rgba" if path.suffix == ".webm" else "rgb24"
    with av.open(str(path)) as film:
        track = film.streams.video[0]
        decoder = av.CodecContext.create("libvpx-vp9", "r") if layout == "rgba" else None  # the other one drops alpha
        packets = film.demux(track)
        frames = (frame for packet in packets for frame in (decoder or track).decode(packet if packet.size else None))
        return [(float(frame.pts * track.time_base), frame.to_ndarray(format=layout)) for frame in frames]


def test_outputs_come_as_films_with_the_frames_times(film: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    wanted = Products(overlay=True, films=("mask", "overlay", "cutout"))
    run_batch(film, out, executor=INPROCESS, products=wanted, exclude=["*_000003.mp4"])
    times = [number / 25 for number in range(12) if number != 3]
    masks, overlays, cutouts = (played(out / f"film_{kind}") for kind in ("mask.mp4", "overlay.mp4", "cutout.webm"))
    for frames in (masks, overlays, cutouts):
        assert [time for time, _ in frames] == pytest.approx(times, abs=2e-3)
    for (_, found), path in zip(masks, sorted((out / "masks").iterdir()), strict=True):
        assert (found == cv2.imread(str(path), 0)[:, :, None]).all()
        assert np.minimum(found, 255 - found).max() < 8  # of the layout, none of the codec
    alpha = cutouts[0][1][:, :, 3]
    assert np.abs(alpha.astype(int) - masks[0][1][:, :, 0]).mean() < 8
    seen = Silent()
    assert run_batch(film, out, executor=INPROCESS, exclude=["*_000003.mp4"], observer=seen).unchanged == 11
    assert (played(out / "film_mask.mp4")[0][1] == masks[0][1]).all()
    assert seen.notes == []  # it still shows what is there
    run_batch(film, out, executor=INPROCESS, observer=seen)
    assert seen.notes[0].startswith("film_cutout.webm shows an earlier state; ask for it to have it made anew")
    run_batch(film, out, executor=INPROCESS, overwrite=True)
    assert not (out / "film_mask.mp4").exists()


def test_a_film_of_a_folder_is_called_by_it_and_never_replaces_an_input(film: Path, tmp_path: Path) -> None:
    (tmp_path / "in" / "day").mkdir(parents=True)
    for number, pixels in enumerate(pictures(3, (61, 47))):
        cv2.imwrite(str(tmp_path / "in" / "day" / f"{number}.png"), pixels)
    run_batch(tmp_path / "in", tmp_path / "out", executor=INPROCESS, products=Products(films=("mask",)))
    assert [pixels.shape for _, pixels in played(tmp_path / "out" / "day_mask.mp4")] == [(48, 62, 3)] * 3
    film.rename(tmp_path / "film_mask.mp4")
    before = (tmp_path / "film_mask.mp4").read_bytes()
    twice = write_film(tmp_path / "film.mp4", pictures(2))
    films, asked = [tmp_path / "film_mask.mp4", twice], {"executor": INPROCESS, "products": Products(films=("mask",))}
    with pytest.raises(UsageError, match="no run made it"):
        run_batch(films, tmp_path, **asked)
    summary = run_batch(films, tmp_path, overwrite=True, **asked)
    assert any("film_mask.mp4 would replace an input" in text for text in summary.problems)
    assert (tmp_path / "film_mask.mp4").read_bytes() == before


def test_films_last_as_long_as_theirs_whatever_failed_or_shares_a_name(tmp_path: Path) -> None:
    for name in ("a.mp4", "a.mkv"):
        write_film(tmp_path / name, pictures(4), rate=10)
    (tmp_path / "in").mkdir()
    for number, pixels in enumerate(pictures(4)):
        cv2.imwrite(str(tmp_path / "in" / f"{number}.png"), pixels)
    (tmp_path / "in" / "1.png").write_text("no picture")
    options = {"executor": INPROCESS, "products": Products(films=("mask",)), "keep_suffix": True}
    run_batch([tmp_path / "a.mp4", tmp_path / "a.mkv", tmp_path / "in"], tmp_path / "out", **options)
    found = {path.name: path for path in (tmp_path / "out").glob("*.mp4")}
    assert sorted(found) == ["a.mkv_mask.mp4", "a.mp4_mask.mp4", "images_mask.mp4"]
    assert [time for time, _ in played(found["images_mask.mp4"])] == pytest.approx([0, 0.08, 0.12], abs=1e-4)
    with av.open(str(found["a.mp4_mask.mp4"])) as film:
        assert (film.streams.video[0].average_rate, film.duration) == (10, 400_000)


def test_no_film_is_made_where_no_frame_was(tmp_path: Path) -> None:
    (tmp_path / "film.mp4").write_bytes(bytes(range(256)) * 8)
    products = Products(films=("mask",))
    summary = run_batch(tmp_path / "film.mp4", tmp_path / "out", executor=INPROCESS, products=products)
    assert (summary.failed, summary.problems) == (1, [])
    assert not list((tmp_path / "out").glob("*.mp4"))
