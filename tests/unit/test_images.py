"""Guarded reading: right pixels or a refusal by name, never other values, a hang or a large allocation."""

import contextlib
import io
import os
import pickle
import re
import subprocess
import sys
import tracemalloc
from itertools import product
from pathlib import Path

import bad_images
import cv2
import damage
import numpy as np
import pytest
import readings
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from ffseg.errors import ImageReadError, ParameterError
from ffseg.io.images import REASONS, Limits, decode_image, inspect, read_image, read_picture
from ffseg.io.validation.headers import looks_like

CASES = bad_images.all_cases()
needs_gif = pytest.mark.skipif(not bad_images.READS_GIF, reason="this OpenCV reads no GIF")


@pytest.mark.parametrize("case", [case for case in CASES if case.pixels is not None], ids=lambda case: case.name)
def test_good_and_odd_images_give_their_pixels(case: bad_images.Case) -> None:
    image, expected = decode_image(case.data), case.pixels
    assert (image.dtype, image.shape[:2]) == (np.uint8, expected.shape[:2])
    if expected.ndim == 3 and image.ndim == 2:
        image = np.dstack([image] * 3)
    assert np.abs(image.astype(int) - expected.reshape(image.shape)).max() <= case.tolerance


@pytest.mark.parametrize("case", [case for case in CASES if case.pixels is None], ids=lambda case: case.name)
def test_bad_images_are_refused_with_a_known_reason(case: bad_images.Case, tmp_path: Path) -> None:
    path = tmp_path / case.name
    path.write_bytes(case.data)
    with pytest.raises(ImageReadError) as caught:
        read_image(path)
    assert caught.value.reason in case.reasons
    assert caught.value.reason in REASONS
    assert case.name in str(caught.value)


def test_bombs_are_refused_before_anything_is_allocated() -> None:
    for case in bad_images.bombs():
        tracemalloc.start()
        with pytest.raises(ImageReadError):
            decode_image(case.data)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 2_000_000, case.name


@pytest.mark.parametrize(
    ("name", "words"),
    [("page.jpg", "HTML"), ("pointer.png", "git lfs pull"), ("drawing.png", "SVG"), ("archive.png", "zip"),
     ("note.png", "text file"), ("zeros.jpg", "zeros"), ("float.pfm", "floats")],
)  # fmt: skip
def test_message_says_what_the_file_looks_like(name: str, words: str) -> None:
    case = next(case for case in CASES if case.name == name)
    with pytest.raises(ImageReadError, match=words):
        decode_image(case.data)


def test_limits_are_kept() -> None:
    data = bad_images.plain_files()["png"]
    assert decode_image(data, Limits(max_pixels=64 * 48)).shape == (48, 64, 3)
    with pytest.raises(ImageReadError) as caught:
        decode_image(data, Limits(max_pixels=64 * 48 - 1))
    assert caught.value.reason == "too-many-pixels"


STARVED = """
import resource, sys
from pathlib import Path
from ffseg.io.images import decode_image
data = Path(sys.argv[1]).read_bytes()
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + (16 << 20),) * 2)
try:
    decode_image(data)
except MemoryError:
    print("no memory")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_an_image_for_which_there_is_no_memory_is_not_called_damaged(tmp_path: Path) -> None:
    """OpenCV's decoder gives nothing in both cases, and the advice was to copy the file again."""
    Image.new("RGB", (4000, 4000), (9, 99, 199)).save(tmp_path / "large.png")
    command = [sys.executable, "-c", STARVED, tmp_path / "large.png"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout == "no memory\n", done.stderr


def test_file_above_the_byte_limit_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(bad_images.plain_files()["png"])
    with pytest.raises(ImageReadError) as caught:
        read_image(tmp_path / "a.png", Limits(max_bytes=100))
    assert caught.value.reason == "too-many-bytes"


def _special_files(folder: Path) -> dict[Path, str]:
    pipe, loop, dangling, secret = folder / "pipe.png", folder / "loop.png", folder / "gone.png", folder / "secret.png"
    os.mkfifo(pipe)
    loop.symlink_to(loop)
    dangling.symlink_to(folder / "nowhere")
    secret.write_bytes(bad_images.plain_files()["png"])
    secret.chmod(0)
    special = {pipe: "not-a-file", loop: "link-loop", dangling: "missing", folder: "not-a-file"}
    special[folder / ("n" * 256)] = "bad-name"
    special[folder / "nul\0.png"] = "bad-name"
    special[Path("/dev/zero")] = "not-a-file"
    if os.geteuid() != 0:  # root reads every file
        special[secret] = "unreadable"
    return special


def test_pipes_devices_folders_loops_are_refused_at_once(tmp_path: Path) -> None:
    for path, reason in _special_files(tmp_path).items():
        with pytest.raises(ImageReadError) as caught:  # one that waits for a pipe or reads a device never comes here
            read_image(path)
        assert caught.value.reason == reason, path


@pytest.mark.parametrize(
    "name", [b"\xff\xfe.png", "\U0001f600.png".encode(), b"-rf.png", b"a\nb.png", b"n" * 251 + b".png"]
)
def test_odd_names_are_read_and_shown_as_one_line(name: bytes, tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(name)
    path.write_bytes(bad_images.plain_files()["png"])
    assert read_image(path).shape == (48, 64, 3)
    path.write_bytes(b"GIF89a")
    with pytest.raises(ImageReadError) as caught:
        read_image(path)
    str(caught.value).encode("utf-8")
    assert "\n" not in str(caught.value)


def _tiff_variants() -> list[tuple[str, bytes, np.ndarray]]:
    tifffile = pytest.importorskip("tifffile")
    rgb = bad_images.picture()
    grey = rgb[..., 0]
    variants = []
    for bits, samples, tile, planar, coding, order, big in product(
        ("u1", "u2", "i2", "f4"), (1, 2, 3, 4), (None, (16, 16)),
        ("contig", "separate"), (None, "zlib"), "<>", (False, True),
    ):  # fmt: skip
        base = grey if samples == 1 else np.dstack([rgb, grey])[..., :samples]
        stored = {"u1": base, "u2": base.astype("u2") * 257, "i2": base.astype("i2") * 90, "f4": base / np.float32(255)}
        pixels = np.moveaxis(stored[bits], -1, 0) if planar == "separate" and samples > 1 else stored[bits]
        options = {"extrasamples": ["unspecified"]} if samples in (2, 4) else {}
        options |= {"planarconfig": planar} if samples > 1 else {}
        buffer = io.BytesIO()
        kind = "rgb" if samples >= 3 else "minisblack"
        tifffile.imwrite(
            buffer, pixels, photometric=kind, tile=tile, compression=coding, byteorder=order, bigtiff=big, **options
        )
        name = f"{bits}x{samples}-{tile}-{planar}-{coding}-{order}-{big}"
        variants.append((name, buffer.getvalue(), base if samples == 1 else base[..., 2::-1]))
    return variants


def test_tiff_variants_are_read_right_or_refused_by_name() -> None:
    pytest.importorskip("tifffile")
    read, refused = 0, set()
    for name, data, expected in _tiff_variants():
        try:
            image = decode_image(data)
        except ImageReadError as error:
            refused.add(error.reason)
            continue
        read += 1
        np.testing.assert_array_equal(image, expected, err_msg=name)
    assert refused <= {"unsupported-pixels", "damaged"}
    assert read >= 40  # grey and colour strips of 8 and 16 bits, in both byte orders, classic and big, are no luxury


@given(data=st.data())
def test_flipped_bytes_never_escape_the_list_of_reasons(data: st.DataObject) -> None:
    suffix = data.draw(st.sampled_from(sorted({*bad_images.plain_files()} - {"progressive.jpg"})))
    content = bytearray(bad_images.plain_files()[suffix])
    places = data.draw(st.lists(st.tuples(st.integers(0, min(len(content) - 1, 400)), st.integers(0, 255)), max_size=6))
    for place, value in places:
        content[place] = value
    try:
        assert decode_image(bytes(content), Limits(max_pixels=1_000_000)).size
    except ImageReadError as error:
        assert error.reason in REASONS


def _frames(kind: str, **options: object) -> bytes:
    """Two frames, the second the negative of the first."""
    image = Image.fromarray(bad_images.picture())
    negative = Image.fromarray(255 - bad_images.picture())
    if kind == "GIF":
        image, negative = image.quantize(64), negative.quantize(64)
    return bad_images.encoded(image, kind, save_all=True, append_images=[negative], **options)


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("PNG", {}), ("PNG", {"default_image": True}), pytest.param("GIF", {}, marks=needs_gif), ("WEBP", {"lossless": True}),
        ("TIFF", {"compression": "tiff_lzw"}), ("TIFF", {}),
    ],
)  # fmt: skip
def test_first_of_several_frames_is_read(kind: str, options: dict[str, object]) -> None:
    data = _frames(kind, **options)
    assert inspect(data, Limits()).several
    np.testing.assert_array_equal(decode_image(data), readings.pillow(data))


def test_the_note_on_several_frames_names_what_was_read() -> None:
    assert (
        read_picture(_frames("WEBP"))[1]
        == "only the first frame was read; the WebP file has more: ffseg run --film takes all"
    )
    assert (
        read_picture(_frames("TIFF"))[1]
        == "only the first page was read; the TIFF file has more: ffseg run --film takes all"
    )
    assert read_picture(bad_images.plain_files()["tif"])[1] == ""


@pytest.mark.parametrize("suffix", ["png", "jpg", "webp"])
def test_the_note_says_that_exif_turned_the_pixels(suffix: str) -> None:
    case = {case.name: case.data for case in bad_images.odd_cases()}
    assert read_picture(case[f"turned1.{suffix}"])[1] == ""
    assert "turned upright as EXIF orientation 6 says" in read_picture(case[f"turned6.{suffix}"])[1]


@pytest.mark.parametrize("suffix", ["png", "jpg", "webp"])
@pytest.mark.parametrize("kind", [1, 2, 4, 5, 7, 9, 12])
def test_an_orientation_of_another_type_turns_nothing(suffix: str, kind: int) -> None:
    data = next(case.data for case in bad_images.odd_cases() if case.name == f"turned6.{suffix}")
    entry = re.search(rb"\x12\x01\x03\x00|\x01\x12\x00\x03", data)
    word = bytes([kind, 0]) if entry[0][2] else bytes([0, kind])
    data = data[: entry.start() + 2] + word + data[entry.end() :]
    if suffix == "png":
        at = data.index(b"eXIf")
        end = at + 4 + int.from_bytes(data[at - 4 : at], "big")
        data = data[: at - 4] + bad_images.png_chunk(b"eXIf", data[at + 4 : end]) + data[end + 4 :]
    assert decode_image(data).shape == bad_images.picture().shape


def test_what_follows_a_damaged_webp_image_is_not_taken_for_it() -> None:
    """OpenCV's decoder reads on behind the chunk of the image: one byte in three went unnoticed, Pillow refuses them."""
    exif = Image.Exif()
    exif[0x112] = 1
    image = Image.fromarray(damage.picture())
    data = bad_images.encoded(image, "WEBP", quality=70, exif=exif, xmp=b"<x/>" * 40)
    assert decode_image(data).shape == (192, 256, 3)
    unlike = []
    for place in np.random.default_rng(0).integers(60, data.index(b"EXIF"), 150):
        changed = data[:place] + bytes([data[place] ^ 0x55]) + data[place + 1 :]
        try:
            decode_image(changed)
        except ImageReadError:
            continue
        if readings.pillow(changed) is None:
            unlike.append(int(place))
    assert unlike == []


def test_single_frames_are_not_called_several() -> None:
    for suffix, data in bad_images.plain_files().items():
        assert not inspect(data, Limits()).several, suffix


@needs_gif
def test_open_ground_of_a_gif_has_the_background_colour() -> None:
    image = Image.fromarray(bad_images.picture()).quantize(16)
    data = bytearray(bad_images.encoded(image, "GIF", transparency=5))
    data[6:10], data[11] = (80).to_bytes(2, "little") + (60).to_bytes(2, "little"), 7  # canvas and background
    palette = np.asarray(image.getpalette()).reshape(-1, 3)[:, ::-1]
    numbers = np.full((60, 80), 7)
    numbers[:48, :64] = np.where(np.asarray(image) == 5, 7, np.asarray(image))
    np.testing.assert_array_equal(decode_image(bytes(data)), palette[numbers])


def test_orientation_in_xmp_is_not_looked_at() -> None:
    packet = b'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:Description tiff:Orientation="6"/></x:xmpmeta>'
    head = b"http://ns.adobe.com/xap/1.0/\0" + packet
    data = bad_images.encoded(Image.fromarray(bad_images.picture()), "JPEG")
    data = data[:2] + b"\xff\xe1" + (len(head) + 2).to_bytes(2, "big") + head + data[2:]
    assert decode_image(data).shape == (48, 64, 3)


def heic_file(pixels: np.ndarray) -> bytes:
    """A HEIC file of an RGB picture, as cameras write them: lossy, turned by a tag."""
    heif = pytest.importorskip("pillow_heif", reason="pillow-heif is not installed")
    target = io.BytesIO()
    image = heif.from_bytes("RGB", (pixels.shape[1], pixels.shape[0]), pixels.tobytes())
    image.save(target, quality=95)
    return target.getvalue()


@pytest.mark.parametrize("shape", [(64, 96), (63, 95)])
def test_heic_pictures_are_read_and_cut_ones_refused(shape: tuple[int, int]) -> None:
    """Those of odd sides are coded a pixel longer and cropped."""
    yy, xx = np.indices(shape)
    colours = np.dstack([2 * xx, 3 * yy, 255 - xx - yy]).astype(np.uint8)
    data = heic_file(colours)
    whole = decode_image(data)
    assert whole.shape == (*shape, 3)
    assert np.abs(whole[..., ::-1].astype(int) - colours).mean() < 4
    for length in range(12, len(data), 7):
        with pytest.raises(ImageReadError) as caught:
            decode_image(data[:length])
        assert caught.value.reason in REASONS
    for part in (slice(-len(data) // 3, None), slice(-len(data) // 2, -len(data) // 4)):  # a tail, a hole
        holed = bytearray(data)
        holed[part] = bytes(len(holed[part]))
        with pytest.raises(ImageReadError, match="in a row are zeros"):
            decode_image(bytes(holed))
    rng = np.random.default_rng(3)
    for place, value in zip(rng.integers(0, len(data), 60), rng.integers(0, 256, 60), strict=True):
        changed = bytearray(data)
        changed[place] = value
        with contextlib.suppress(ImageReadError):
            decode_image(bytes(changed))


def test_heic_without_its_package_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    data = heic_file(np.zeros((16, 16, 3), np.uint8))
    monkeypatch.setitem(sys.modules, "pillow_heif", None)
    with pytest.raises(ImageReadError, match=r"pip install 'ffseg\[heif\]', or convert it to PNG") as caught:
        decode_image(data)
    assert caught.value.reason == "unsupported-pixels"


def deep_file(values: np.ndarray, kind: str, **tags: object) -> bytes:
    """A file of 16-bit values; tags of a TIFF by their number."""
    if kind == "png":
        return cv2.imencode(".png", values)[1].tobytes()
    target = io.BytesIO()
    extra = [(int(tag[1:]), "H", 1, value, True) for tag, value in tags.items()]
    tifffile = pytest.importorskip("tifffile")
    tifffile.imwrite(target, values, photometric="rgb" if values.ndim == 3 else "minisblack", extratags=extra)
    return target.getvalue()


@pytest.mark.parametrize("kind", ["png", "tif"])
@pytest.mark.parametrize("shape", [(40, 60), (40, 60, 3)])
def test_twelve_bits_in_sixteen_are_read_by_their_own_range(kind: str, shape: tuple[int, ...]) -> None:
    """They were read as 0 to 15 grey levels of 255."""
    values = np.random.default_rng(5).integers(100, 4000, shape).astype(np.uint16)
    pixels, note = read_picture(deep_file(values, kind))
    expected = np.rint(values * (255 / 4095))
    order = slice(None, None, -1) if kind == "tif" and len(shape) == 3 else slice(None)
    assert np.abs(pixels - expected[..., order]).max() <= 1
    assert note == "16-bit values read from 0 to 4095: no value needs more than 12 bits; input.range sets others"
    pixels, note = read_picture(deep_file(values, kind), levels=(0, 65535))
    assert (pixels.max() <= 16, note) == (True, "")
    whole = (values * 16).astype(np.uint16)
    whole.flat[0] = 65535
    pixels, note = read_picture(deep_file(whole, kind))
    assert note == ""
    assert np.array_equal(pixels, decode_image(deep_file(whole, kind)))


def test_a_range_that_a_tiff_states_is_taken() -> None:
    values = np.random.default_rng(5).integers(100, 2000, (40, 60)).astype(np.uint16)
    pixels, note = read_picture(deep_file(values, "tif", t280=100, t281=2099))
    assert "16-bit values read from 100 to 2099: as the file states" in note
    assert np.array_equal(pixels, np.rint((values - 100.0) * np.float32(255 / 1999)))


@pytest.mark.parametrize(
    ("data", "what"),
    [(b"", "an empty file"), (b"\0" * 9, "zeros only"), (b"#ROSBAG V2.0\n", "--bag"), (b"\x89MCAP0\r\n", "--bag")],
)
def test_what_is_no_image_is_named(data: bytes, what: str) -> None:
    assert what in looks_like(data)


@pytest.mark.parametrize("levels", [(5, 1), (5, 5), (0, np.nan), "x", (0, 1, 2), ("a", "b")])
def test_black_lies_below_white(levels: object) -> None:
    said = r"levels: .* is not \"auto\", None or \(black, white\), black below white"
    with pytest.raises(ParameterError, match=said):
        read_image("any.png", levels=levels)


def test_an_image_that_cannot_be_read_comes_out_of_a_pool_of_processes() -> None:
    error = pickle.loads(pickle.dumps(ImageReadError("missing", "there is no such file")))
    assert (type(error), error.reason, str(error)) == (ImageReadError, "missing", "there is no such file")
