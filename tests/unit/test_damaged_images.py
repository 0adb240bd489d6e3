"""Damaged files: refused where their coding can tell, and else read as other programs read them."""

import io

import bad_images
import damage
import naive_packing
import numpy as np
import pytest
import readings
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image, features

from ffseg.errors import ImageReadError
from ffseg.io.images import Limits, decode_image, inspect
from ffseg.native import _core

SOURCES = damage.sources()
TELL_ZEROS = sorted(name for name in SOURCES if not name.endswith(("bmp", "pgm", "ppm", "pbm", "none.tif")))
"""Where pixels are packed, no whole file looks like one with a tail of zeros."""
NO_HOLES = sorted(set(TELL_ZEROS) - {"progressive.jpg", "lossless.jp2", "lossy.jp2"})
CHECKSUMS = sorted(name for name in SOURCES if name.endswith("png") or name in ("deflate.tif", "last.tif", "16.tif"))


def refused(data: bytes) -> bool:
    try:
        decode_image(data, Limits(max_pixels=5_000_000))
    except ImageReadError:
        return True
    return False


@pytest.mark.parametrize("name", sorted(SOURCES))
def test_whole_files_are_read_as_pillow_reads_them(name: str) -> None:
    data = SOURCES[name]
    assert readings.same(decode_image(data), readings.pillow(data), damage.tolerance(name))


TOLD = [(TELL_ZEROS, "tail"), (TELL_ZEROS, "cut"), (NO_HOLES, "hole"), (CHECKSUMS, "bit")]


@pytest.mark.parametrize(("name", "kind"), [(name, kind) for names, kind in TOLD for name in names])
def test_damage_that_shows_is_refused(name: str, kind: str) -> None:
    damaged = [item for item in damage.damaged(name, SOURCES[name], 0) if item.kind == kind]
    assert [item.number for item in damaged if not refused(item.data)] == []


@pytest.mark.parametrize("name", sorted(SOURCES))
def test_what_is_read_of_damaged_files_is_what_pillow_or_libvips_read(name: str, request) -> None:
    wrong = []
    for item in damage.damaged(name, SOURCES[name], 300 if request.config.getoption("--long") else 40):
        if refused(item.data):
            continue
        image = decode_image(item.data)
        others = [reading for read in (readings.pillow, readings.vips) if (reading := read(item.data)) is not None]
        if not any(readings.same(image, other, damage.tolerance(name)) for other in others):
            wrong.append((item.kind, item.number))
    assert wrong == []


def test_flat_webp_ends_in_zeros_and_is_whole() -> None:
    noise = np.random.default_rng(1).integers(0, 256, (240, 300, 3)).astype(np.uint8)
    noise[100:] = 0
    data = bad_images.encoded(Image.fromarray(noise), "WEBP", lossless=True, method=0, quality=0)
    assert data[-4096:] == bytes(4096)
    np.testing.assert_array_equal(decode_image(data), noise[..., ::-1])


def test_zeros_in_the_first_frame_of_an_animated_webp_are_refused() -> None:
    image = Image.fromarray(damage.picture())
    data = bad_images.encoded(image, "WEBP", save_all=True, append_images=[image.rotate(180)], lossless=False)
    at = data.index(b"VP8 ")
    end = at + 8 + int.from_bytes(data[at + 4 : at + 8], "little")
    assert decode_image(data).shape == (192, 256, 3)
    assert refused(data[: end - 900] + bytes(880) + data[end - 20 :])


def test_flat_jpeg_holds_zeros_and_is_whole() -> None:
    data = bad_images.encoded(Image.new("L", (600, 600)), "JPEG", optimize=True)
    assert bytes(500) in data
    np.testing.assert_array_equal(decode_image(data), np.zeros((600, 600), np.uint8))


def test_trailing_data_of_a_jpeg_is_no_part_of_it() -> None:
    data = bad_images.plain_files()["jpg"]
    clip = bytes(4096) + data  # a phone's moving picture, or a second view
    np.testing.assert_array_equal(decode_image(data + clip), decode_image(data))


@pytest.mark.parametrize("scans", [(300, True), (300, False)])
def test_scans_are_counted(scans: tuple[int, bool]) -> None:
    assert decode_image(bad_images.many_scans(50)).shape == (48, 64, 3)
    with pytest.raises(ImageReadError, match="scans, made to waste time"):
        decode_image(bad_images.many_scans(*scans))


@pytest.mark.parametrize("name", ["zTXt", "iTXt", "iCCP"])
def test_no_decoder_sees_texts_it_would_unpack(name: str) -> None:
    data = next(case.data for case in bad_images.odd_cases() if case.name == f"odd_{name}_bomb.png")
    still = inspect(data, Limits()).still
    assert data.count(name.encode()) == 40
    assert name.encode() not in still
    assert len(still) < 20_000


@pytest.mark.parametrize(
    "options",
    [
        {"tile_size": (60, 50)}, {"precinct_size": (64, 64)}, {"codeblock_size": (16, 16)}, {"num_resolutions": 1},
        {"quality_mode": "rates", "quality_layers": [40, 20, 10, 1]}, {"progression": "RPCL", "irreversible": True},
        {"tile_size": (60, 50), "precinct_size": (32, 32), "quality_mode": "rates", "quality_layers": [30, 1]},
        {"num_resolutions": 8},
    ],
)  # fmt: skip
def test_whole_jpeg_2000_files_hold_the_packets_they_claim(options: dict[str, object]) -> None:
    data = bad_images.encoded(Image.fromarray(damage.picture()), "JPEG2000", **options)
    np.testing.assert_array_equal(decode_image(data), readings.pillow(data))


@pytest.mark.parametrize(
    ("name", "words"), [("layers", "packets"), ("precincts", "packets"), ("blocks", "code blocks"), ("tiles", "tiles")]
)
def test_jpeg_2000_files_that_claim_more_than_they_hold_are_named(name: str, words: str) -> None:
    data = next(case.data for case in bad_images.bombs() if case.name == f"bomb_{name}.jp2")
    with pytest.raises(ImageReadError, match=words):
        decode_image(data)


def test_a_side_that_no_method_takes_is_refused() -> None:
    data = b"P5\n1 70000\n255\n" + bytes(70_000)
    with pytest.raises(ImageReadError, match="1x70000 pixels: no side may be longer than 65535") as caught:
        decode_image(data)
    assert caught.value.reason == "too-many-pixels"


@pytest.mark.skipif("avif" not in features.get_supported_modules(), reason="this Pillow writes no AVIF")
def test_frame_of_another_size_is_named() -> None:
    with pytest.raises(ImageReadError, match="claims 90x70 pixels, its frame is 64x48"):
        decode_image(bad_images.avif_claim(90, 70))


def _strips(image: np.ndarray, compression: str) -> list[bytes]:
    """Packed strips of 24 rows."""
    data = bad_images.encoded(Image.fromarray(image), "TIFF", compression=compression, tiffinfo={278: 24})
    found = Image.open(io.BytesIO(data)).tag_v2
    return [data[at : at + n] for at, n in zip(found[273], found[279], strict=True)]


@given(data=st.binary(max_size=300))
def test_lengths_of_packed_bytes_are_those_of_the_naive_unpackers(data: bytes) -> None:
    packed = b"\x80" + data  # mostly a clear code
    for content in (data, packed):
        assert _core.lzw_size(content) == naive_packing.lzw_size(content)
        assert _core.packbits_size(content) == naive_packing.packbits_size(content)


@given(levels=st.sampled_from([2, 7, 256]), width=st.integers(1, 900), seed=st.integers(0, 99))
def test_strips_of_encoders_have_the_length_of_their_rows(levels: int, width: int, seed: int) -> None:
    image = np.random.default_rng(seed).integers(0, levels, (40, width), dtype=np.uint8)
    for compression, size in (("tiff_lzw", _core.lzw_size), ("packbits", _core.packbits_size)):
        assert [size(packed) for packed in _strips(image, compression)] == [24 * width, 16 * width]
