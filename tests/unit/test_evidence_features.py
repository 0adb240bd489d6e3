"""Features as a value, and the model file."""

import hashlib
import json
import struct
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from ffseg.errors import ParameterError, SegmentationError
from ffseg.evidence.features import ALL_FEATURES, SHAPELESS_FEATURES, enlarged, features, reduced_mean
from ffseg.evidence.forest import MAGIC, Forest, Model, from_bytes, load_model, to_bytes
from ffseg.image.appearance import Appearance, reduction
from ffseg.image.parts import dilated
from tests.discs import disc_of
from tests.stumps import probabilities, stump

SHAPE = (90, 130)
disc = disc_of(SHAPE)


def photograph() -> np.ndarray:
    image = np.random.default_rng(3).integers(90, 110, (*SHAPE, 3), np.uint8)
    image[:, 80:] //= 3
    return image


def test_all_features_are_finite_and_named_once() -> None:
    seen = features(Appearance(photograph(), 65, even=False), disc(30, 40, 8))
    assert (seen.factor, tuple(seen.planes)) == (2, ALL_FEATURES)
    assert len(set(ALL_FEATURES)) == len(ALL_FEATURES)
    assert all(plane.shape == (45, 65) and np.isfinite(plane).all() for plane in seen.planes.values())


def test_what_is_named_is_found_whatever_else_is_looked_for() -> None:
    some, most = (
        features(Appearance(photograph()), disc(30, 40, 8), names) for names in (SHAPELESS_FEATURES, ALL_FEATURES)
    )
    assert set(SHAPELESS_FEATURES) < set(ALL_FEATURES)
    for name in SHAPELESS_FEATURES:
        np.testing.assert_array_equal(some[name], most[name])


@pytest.mark.parametrize("width", [1, 3, 5, 9])
def test_widened_is_the_largest_of_the_square_round_a_pixel(width: int) -> None:
    plane = np.random.default_rng(5).random((13, 17), np.float32)
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(plane, width // 2), (width, width))
    np.testing.assert_array_equal(dilated(plane, width), windows.max(axis=(2, 3)))


def test_the_barrier_of_a_border_is_its_gradient() -> None:
    seen = features(Appearance(photograph(), 130, even=False), disc(30, 40, 8))
    assert seen["barrier@1.5"][40, 60] < 1 < seen["barrier@1.5"][40, 120]
    assert seen["reached@1.5"][40, 120] > 0.95
    assert seen["from_start@1.5"][40, 120] > 5 > seen["from_start@1.5"][40, 60]
    assert seen["distance"][40, 30] < 0.01 < seen["distance"][40, 120]


def test_grey_is_colour_without_a_and_b() -> None:
    grey = photograph()[..., 0]
    one, other = (
        features(Appearance(image), disc(30, 40, 8)) for image in (grey, np.repeat(grey[..., None], 3, axis=2))
    )
    assert all(np.array_equal(one[name], other[name]) for name in ALL_FEATURES)


def test_a_small_start_keeps_a_pixel_and_an_empty_one_is_refused() -> None:
    assert features(Appearance(photograph(), 16), disc(31, 41, 0.5)).inside.sum() == 1
    with pytest.raises(SegmentationError, match="start region"):
        features(Appearance(photograph()), np.zeros(SHAPE, bool))


def test_means_of_blocks_and_back() -> None:
    plane = np.arange(7 * 5, dtype=np.float32).reshape(7, 5)
    small = reduced_mean(plane, 2)
    assert (small.shape, small[0, 0]) == ((4, 3), plane[:2, :2].mean())
    assert small[3, 2] == plane[6, 4]
    slope = np.repeat(np.arange(40, dtype=np.float32)[None], 8, axis=0)
    back = enlarged(reduced_mean(slope, 4), 4, slope.shape)
    np.testing.assert_allclose(back[:, 2:-2], slope[:, 2:-2], atol=1e-5)  # between block middles a slope is itself


def test_reduction_is_a_whole_factor() -> None:
    assert [reduction((h, w)) for h, w in ((360, 480), (400, 400), (401, 10), (1, 1))] == [2, 1, 2, 1]


def test_a_forest_survives_its_file(tmp_path: Path) -> None:
    forest = Model(stump("barrier@1.5", 1.0, -3), about={"masks": 1})
    seen = features(Appearance(photograph(), 65, even=False), disc(30, 40, 8))
    (tmp_path / "a.ffmodel").write_bytes(to_bytes(forest))
    again = load_model(tmp_path / "a.ffmodel")
    assert (again.about, to_bytes(again)) == ({"masks": 1}, to_bytes(forest))
    np.testing.assert_array_equal(again.map(seen), forest.map(seen))
    assert forest.map(seen)[40, 60] > 0.9 > 0.1 > forest.map(seen)[40, 120]


def test_a_forest_of_few_features_asks_for_those_only() -> None:
    full, seen = stump("barrier@1.5", 1.0), features(Appearance(photograph(), 65, even=False), disc(30, 40, 8))
    few = Forest({**full.arrays, "feature": np.zeros(1, np.int32)}, ("barrier@1.5",), full.bias)
    np.testing.assert_array_equal(probabilities(few, seen), probabilities(full, seen))


def test_a_model_may_hold_a_second_forest(tmp_path: Path) -> None:
    both = Model(stump("x", 0.5), stump("y", 0.25), size=300)
    (tmp_path / "a.ffmodel").write_bytes(to_bytes(both))
    again = load_model(tmp_path / "a.ffmodel")
    assert (again.size, again.start.arrays["threshold"].tolist()) == (300, [0.25])
    assert again.inside.arrays["threshold"].tolist() == [0.5]


def sealed(header: object, body: bytes, length: int | None = None) -> bytes:
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    data = MAGIC + struct.pack("<I", len(text) if length is None else length) + text + body
    return data + hashlib.sha256(data).digest()


FILE = to_bytes(Model(stump("x", 0.5), about={"masks": 1}))


def parts() -> tuple[dict[str, object], bytes]:
    start = len(MAGIC) + 4
    length = struct.unpack("<I", FILE[len(MAGIC) : start])[0]
    return json.loads(FILE[start : start + length]), FILE[start + length : -32]


HEADER, BODY = parts()


def header(**changes: object) -> dict[str, object]:
    """The header with some values of its forest changed."""
    return {**HEADER, "forests": {"inside": {**HEADER["forests"]["inside"], **changes}}}  # type: ignore[index]


HOSTILE = {
    "empty": (b"", "empty"),
    "text": (b"hello", "not a model file"),
    "cut": (FILE[:-7], "cut or altered"),
    "altered": (FILE.replace(b"nodes", b"nodez"), "cut or altered"),
    "long-header": (sealed(HEADER, BODY, 1 << 30), "header is longer"),
    "no-json": (sealed(b"{", BODY), "not JSON"),
    "deep": (sealed(b"[" * 60000, BODY), "not JSON"),
    "list": (sealed([1], BODY), "does not have the keys"),
    "missing": (sealed({"nodes": 1}, BODY), "does not have the keys"),
    "size": (sealed({**HEADER, "size": 1 << 20}, BODY), "size in its header"),
    "a size to which no large image is reduced": (sealed({**HEADER, "size": 255}, BODY), "size in its header"),
    "prior": (sealed({**HEADER, "prior": 11}, BODY), "prior in its header"),
    "nan-prior": (sealed(json.dumps({**HEADER, "prior": float("nan")}).encode(), BODY), "prior in its header"),
    "text-prior": (sealed({**HEADER, "prior": True}, BODY), "prior in its header"),
    "no-forest": (sealed({**HEADER, "forests": {}}, BODY), "does not name 'inside'"),
    "more-forests": (sealed({**HEADER, "forests": {**HEADER["forests"], "x": {}}}, BODY), "names more than"),
    "forest": (sealed({**HEADER, "forests": {"inside": 3}}, BODY), "a forest in its header"),
    "huge": (sealed(header(nodes=1 << 40), BODY), "nodes in its header"),
    "bool": (sealed(header(trees=True), BODY), "trees in its header"),
    "negative": (sealed(header(leaves=-1), BODY), "leaves in its header"),
    "more": (sealed(header(leaves=3), BODY), "longer or shorter"),
    "tail": (sealed(HEADER, BODY + b"x"), "longer or shorter"),
    "nan-bias": (sealed(json.dumps(header(bias=float("nan"))).encode(), BODY), "bias in its header"),
    "names": (sealed(header(features=[1]), BODY), "not a list of names"),
    "unknown": (sealed(header(features=["smell"]), BODY), "'smell'"),
    "few": (sealed(header(features=[]), BODY), "not a list of names"),
    "out-of-range": (sealed(header(features=["y"]), BODY.replace(BODY[:4], b"\x09\0\0\0", 1)), "feature that there"),
    "loop": (sealed(HEADER, BODY.replace(b"\xff\xff\xff\xff", b"\0\0\0\0", 1)), "two places"),
    "nan": (sealed(HEADER, BODY.replace(struct.pack("<f", 0.5), struct.pack("<f", np.nan))), "threshold is not finite"),
    "about": (sealed({**HEADER, "about": 1}, BODY), "about"),
    "exposed": (sealed({**HEADER, "exposed": 1}, BODY), "exposed in its header"),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_hostile_model_file_gets_one_sentence(tmp_path: Path, kind: str) -> None:
    data, why = HOSTILE[kind]
    (tmp_path / "bad.ffmodel").write_bytes(data)
    with pytest.raises(ParameterError) as caught:
        load_model(tmp_path / "bad.ffmodel")
    for words in ("bad.ffmodel", why, "ffseg learn"):
        assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_model_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="no.ffmodel"):
        load_model(tmp_path / "no.ffmodel")


def spoiled(data: bytes, rng: np.random.Generator) -> bytes:
    """The file with something changed; mostly sealed again, so that what lies behind the digest is reached."""
    body = bytearray(data[:-32])
    for _ in range(int(rng.integers(1, 5))):
        at, kind = int(rng.integers(0, max(1, len(body)))), int(rng.integers(0, 5))
        if kind == 0:
            body[at : at + 1] = rng.bytes(1)
        elif kind == 1:
            body[at : at + 4] = rng.choice([b"\xff\xff\xff\xff", b"\0\0\0\x80", b"\0\0\xc0\x7f", b"\0\0\0\0"])
        elif kind == 2:
            del body[at : at + int(rng.integers(1, 40))]
        elif kind == 3:
            body[at:at] = body[: int(rng.integers(1, 40))]
        else:
            body[at : at + 1] = rng.choice([b"9", b"-", b"[", b"}", b'"', b"e", b"N"])
    return bytes(body) + (hashlib.sha256(body).digest() if rng.integers(0, 10) else data[-32:])


def test_spoiled_model_files_are_read_or_refused(request: pytest.FixtureRequest) -> None:
    """Bytes changed, cut and repeated: whatever is neither a model nor a refusal ends the test."""
    arrays = {
        "feature": np.array([3, 7, 1, 0], np.int32),
        "threshold": np.array([0.5, -1, 2, 8], np.float32),
        "left": np.array([1, -1, -4, -6], np.int32),
        "right": np.array([-2, -3, -5, -7], np.int32),
        "root": np.array([0, 2, 3], np.int32),
        "value": np.linspace(-1, 1, 7).astype(np.float32),
    }
    data = to_bytes(
        Model(Forest(arrays), Forest(arrays, ALL_FEATURES[:9]), about={"masks": 3}, exposed=True, prior=0.5)
    )
    counts = Counter[str]()
    for number in range(20_000 if request.config.getoption("--long") else 400):
        try:
            model = from_bytes(spoiled(data, np.random.default_rng([0, number])))
            model.inside.log_odds(np.zeros((len(model.inside.features), 2, 3), np.float32))
            counts["read"] += 1
        except ValueError as error:
            counts[str(error).split(",")[0][:60]] += 1
    assert len(counts) > 6
