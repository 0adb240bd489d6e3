"""``ffseg.segment`` as people call it, what a result can do, and the names a signature needs."""

import inspect
import io
import json
import re
import subprocess
import sys
import typing
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

import ffseg
from ffseg.image.checked import taken_image
from ffseg.io.exports import geojson_document
from ffseg.io.images import decode_image
from ffseg.io.saving import annotated_image
from ffseg.metrics import iou
from ffseg.plugins import find
from ffseg.schema.kinds import Integer, Number
from ffseg.schema.sections import leaves
from tests.masks import read_mask

ROOT = Path(__file__).resolve().parents[2]
YY, XX = np.mgrid[:90, :120]
DISC = np.where((XX - 60) ** 2 + (YY - 45) ** 2 < 900, 210, 40).astype(np.uint8)
SMALL = {"init.radius": 10}


@pytest.fixture(scope="module")
def result() -> ffseg.Segmentation:
    return ffseg.segment(DISC, SMALL)


def test_an_image_alone_is_enough() -> None:
    image = ffseg.read_image(ROOT / "samples" / "toy.png")
    assert np.array_equal(ffseg.segment(image).mask, ffseg.segment(image, ffseg.load_params()).mask)


def test_parameters_are_a_preset_a_file_a_dict_or_a_set(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("contour: {degree: 2}\ninit: {radius: 10}\n")
    nested: dict[str, object] = {"contour": {"degree": 2}, "init": {"radius": 10}}
    same = [
        tmp_path / "p.yaml", str(tmp_path / "p.yaml"), {"contour.degree": 2, **SMALL}, nested,
        ffseg.load_params(None, nested),
    ]  # fmt: skip
    points = [ffseg.segment(DISC, one).contours[0].control_points.tolist() for one in same]
    assert all(found == points[0] for found in points)
    assert ffseg.segment(DISC, "toy-fixed").stats.patches != ffseg.segment(DISC, "toy-full").stats.patches
    with pytest.raises(ffseg.ParameterError, match="params is of type int; give a preset's name"):
        ffseg.segment(DISC, 3)  # type: ignore[arg-type]


COLOUR = np.dstack([DISC] * 3)
WRONG = {
    "none": (None, "cv2.imread returns for a file it cannot read"),
    "a name": ("a.png", "ffseg.segment(ffseg.read_image('a.png'))"),
    "a path": (Path("a.png"), "ffseg.segment(ffseg.read_image('a.png'))"),
    "pillow": (Image.fromarray(COLOUR), "np.asarray(image.convert('RGB'))"),
    "list": (DISC.tolist(), "give a NumPy array"),
    "floats": (DISC.astype(float), "image.round().astype(np.uint8)"),
    "colour floats": (COLOUR.astype(float), "image.round().astype(np.uint8)"),
    "bool": (DISC > 99, "image.astype(np.uint8) * 255"),
    "channels first": (COLOUR.transpose(2, 0, 1), "image.transpose(1, 2, 0)"),
    "float, channels first": (COLOUR.transpose(2, 0, 1) / 255, "image.transpose(1, 2, 0)"),
    "stack": (COLOUR[None], "images[0]"),
    "grey stack": (np.stack([DISC] * 9), "image[..., 0] or image[0]"),
    "grey and alpha": (np.dstack([DISC, DISC]), "image[..., 0]"),
    "alpha": (np.dstack([COLOUR, DISC]), "image[..., :3]"),
    "one channel": (DISC[..., None], "image[..., 0]"),
    "nothing": (DISC[:0], "has no pixel"),
    "not a number": (np.full((9, 9), np.nan), "np.nan_to_num(image)"),
    "infinite": (np.where(DISC > 99, np.inf, 0.5), "np.nan_to_num(image)"),
    "masked": (np.ma.masked_less(DISC, 99), "give image.filled(0), and domain=~np.ma.getmaskarray(image)"),
    "complex": (DISC.astype(complex), "is of complex128, which no pixel is"),
}


@pytest.mark.parametrize(("image", "remedy"), WRONG.values(), ids=WRONG)
def test_what_is_no_image_is_told_in_one_sentence_how_to_become_one(image: object, remedy: str) -> None:
    with pytest.raises(ffseg.SegmentationError) as caught:
        ffseg.segment(image)  # type: ignore[arg-type]
    said = str(caught.value)
    assert remedy in said
    assert "\n" not in said
    assert isinstance(image, Image.Image) <= ("rgb=True" in said)
    assert ("colours" in said) <= bool(re.search("colours are taken as BGR.* with rgb=True as RGB", said))


@pytest.mark.parametrize(
    "image", [DISC / 127.5 - 1, DISC.astype(np.int32) * 257, DISC.astype(float), DISC / 1e6 - 3, DISC / 180]
)
def test_the_remedy_for_other_numbers_keeps_what_they_show(image: npt.NDArray[np.number]) -> None:
    with pytest.raises(ffseg.SegmentationError) as caught:
        ffseg.segment(image, SMALL)  # type: ignore[arg-type]
    remedy = str(caught.value).split("give ")[1]
    mask = ffseg.segment(eval(remedy, {"np": np, "image": image}), SMALL).mask  # noqa: S307 - what the sentence says
    assert iou(mask, np.where(DISC > 99, np.uint8(255), np.uint8(0))) > 0.98


def test_16_bits_may_lie_in_either_order() -> None:
    deep = DISC.astype(np.uint16) << 8
    assert np.array_equal(ffseg.segment(deep.astype(">u2"), SMALL).mask, ffseg.segment(deep, SMALL).mask)


EDGES = ffseg.load_params().edges
OTHER = ffseg.edge_map(DISC[:50, :50], EDGES)
EXTRAS = {
    "no method": ({"method": ""}, "method is ''; give a name such as 'freeform', or a function"),
    "a number for a method": ({"method": 3}, "method is 3; give a name"),
    "no such method": ({"method": "freefrm"}, "method: there is no 'freefrm'; did you mean 'freeform'?"),
    "a module for a method": ({"method": "os:path"}, "method: os:path is no function"),
    "no function": ({"callback": 3}, "callback is of type int; give a function"),
    "no edge map": ({"edges": DISC}, "edges is of type ndarray; give an EdgeMap, as of ffseg.edge_map"),
    "another image's edge map": ({"edges": OTHER}, "the edge map has 50 x 50 pixels, the image 120 x 90"),
    "no point": ({"center": 5}, "center is 5; give (x, y) in pixels"),
    "a point beyond all floats": ({"center": (10**400, 0)}, "give (x, y) in pixels"),
    "a masked domain": ({"domain": np.ma.masked_less(DISC, 99)}, "domain is a masked array; give domain.filled(0)"),
    "masked evidence": ({"evidence": np.ma.masked_less(DISC / 255, 0.5)}, "give evidence.filled(0)"),
    "a name for a point": ({"center": ("x", "y")}, "give (x, y) in pixels"),
    "interest points nowhere": ({"altitudes": np.full((1, 4), np.nan)}, "altitudes must be finite"),
    "interest points of a size below 0": ({"altitudes": [[1, 2, 0.1, -1]]}, "radii from 0 to 10000"),
    "interest points far away": ({"altitudes": [[1e6, 2, 0.1, 1]]}, "x and y from -100000 to 100000"),
    "interest points beyond all floats": ({"altitudes": [[10**400, 2, 0.1, 1]]}, "altitudes must be an array"),
    "no evidence": ({"evidence": np.ones((0, 5))}, "evidence"),
    "a name for evidence": ({"evidence": "a.png"}, "evidence must be an array of shape (H, W)"),
    "evidence that is no number": ({"evidence": np.full((90, 120), np.nan)}, "with values from 0 to 1"),
    "no interest points": ({"altitudes": np.ones((2, 3))}, "altitudes must be an array of shape (K, 4)"),
}


@pytest.mark.parametrize(("extra", "said"), EXTRAS.values(), ids=EXTRAS)
def test_other_arguments_are_told_in_one_sentence_what_they_must_be(extra: dict[str, typing.Any], said: str) -> None:
    """An edge map of another image was taken, and found nothing."""
    with pytest.raises(ffseg.FfsegError) as caught:
        ffseg.segment(DISC, SMALL, **extra)
    assert said in str(caught.value)


@pytest.mark.parametrize("method", ["freeform", "snake", "levelset", "cv_floodfill"])
def test_a_domain_bounds_the_contour_on_a_given_edge_map_too(method: str) -> None:
    """It was taken and forgotten, so was the file of domain.mask."""
    flat = np.full((60, 80), 120, np.uint8)
    left, upper = np.zeros(flat.shape, np.bool_), np.zeros(flat.shape, np.bool_)
    left[:, :50] = upper[:40] = True
    start = {"init.center": [20, 20], "init.radius": 6, "edges.source": "gradient"}
    own = ffseg.segment(flat, start, method, domain=left & upper)
    given = ffseg.segment(flat, start, method, domain=left, edges=ffseg.edge_map(flat, EDGES, upper))
    assert own.mask.sum() > 0.8 * (left & upper).sum()  # a snake cuts corners
    assert not given.mask[~(left & upper)].any()
    assert np.array_equal(given.mask, own.mask)


NO_EDGES = {
    "floats": ((DISC / 2.0, EDGES), "for float64 with values from 20 to 105 give image.round"),
    "none": ((None, EDGES), "the image is None"),
    "a row": ((DISC[0], EDGES), "this one has shape"),
    "all parameters": ((DISC, ffseg.load_params()), "give the edges of a parameter set: params.edges"),
    "another domain": ((DISC, EDGES, np.ones((3, 3), np.uint8)), "of the image's shape"),
    "a masked domain": ((DISC, EDGES, np.ma.masked_less(DISC, 99)), "domain.filled"),
    "a domain of floats": ((DISC, EDGES, np.full(DISC.shape, 0.5)), "an array of uint8 or bool"),
}


@pytest.mark.parametrize(("given", "said"), NO_EDGES.values(), ids=NO_EDGES)
def test_an_edge_map_is_made_of_an_image_alone(given: tuple[typing.Any, ...], said: str) -> None:
    """An image from 0 to 1 gave a map without an edge."""
    with pytest.raises(ffseg.SegmentationError, match=said):
        ffseg.edge_map(*given)


def test_the_domain_of_an_edge_map_may_hold_truth_values() -> None:
    domain = np.zeros(DISC.shape, np.bool_)
    domain[:, :60] = True
    found = ffseg.edge_map(DISC, EDGES, domain)
    assert (found.domain.dtype, np.array_equal(found.domain > 0, domain)) == (np.uint8, True)
    assert found.thresholds == ffseg.edge_map(DISC, EDGES, np.where(domain, np.uint8(255), np.uint8(0))).thresholds


def _limits() -> list[dict[str, object]]:
    """Every number of the parameters, with a word beside it or not, at its limits and near zero; starts far away."""
    kinds = {key: getattr(leaf.kind, "other", leaf.kind) for key, leaf in leaves(ffseg.Parameters).items()}
    numbers = {key: kind for key, kind in kinds.items() if isinstance(kind, Integer | Number)}
    values = [(key, value) for key, kind in numbers.items() for value in (kind.low, kind.high, 0, 1e-300, 1e300)]
    values += [
        ("init.circles", [[20, 15, 1e5]]),
        ("init.boxes", [[-1e3, -1e3, 1e3, 1e3]]),
        ("init.center", [1e5, -1e5]),
        ("init.background", [[1e5, 0, 1e-300]]),
        ("edges.canny", [0, 0]),
    ]
    return [{key: value} for key, value in values]


@pytest.mark.parametrize("method", ["freeform", "snake", "levelset", "paper", "cv_floodfill"])
def test_parameters_at_their_limits_give_a_region_or_a_sentence(method: str) -> None:
    """A start a million pixels wide and a balloon of 0 went through to the core, which raised its own errors."""
    image = DISC[30:60, 40:80]
    refused = {}
    for values in _limits():
        try:
            result = ffseg.segment(image, {"init.radius": 6, "contour.max_iterations": 20, **values}, method)
        except ffseg.FfsegError as error:
            refused[next(iter(values.items()))[0]] = str(error)
        else:
            assert all(np.isfinite(contour.control_points).all() for contour in result.contours), values
    assert refused["init.radius"] == "overrides: init.radius: 1e+300 is not a number above 0 and up to 100000"


def test_a_balloon_of_nothing_is_told_before_the_core_is_asked() -> None:
    with pytest.raises(ffseg.ParameterError, match=r"contour\.balloon: 0 moves no free-form contour"):
        ffseg.segment(DISC, {**SMALL, "contour.balloon": 0})


REMEDIES = ("floats", "colour floats", "bool", "channels first", "stack", "alpha", "one channel", "pillow")


@pytest.mark.parametrize("name", REMEDIES)
def test_the_remedy_works(name: str) -> None:
    image, remedy = WRONG[name]
    remedied = eval(remedy, {"np": np, "image": image, "images": image})  # noqa: S307 - our own sentences
    assert ffseg.segment(remedied, {**SMALL, "edges.canny": [5, 10]}).mask.shape == DISC.shape


@given(arrays(np.uint8, (12, 16, 3)), st.sampled_from(["uint16", "float16", "float32", "float64"]), st.booleans())
def test_an_image_is_taken_as_other_libraries_hand_it_out(image: npt.NDArray[np.uint8], kind: str, rgb: bool) -> None:
    """Orders and types of the same picture are one picture; 16 bits as `read_image` takes a file of them."""
    pixels = image[..., ::-1] if rgb else image
    typed = pixels * np.uint16(256) + pixels[::-1] if kind == "uint16" else (pixels / 255).astype(kind)
    taken = taken_image(typed, rgb)
    assert taken.dtype == np.uint8
    assert np.array_equal(taken, image)
    assert np.array_equal(ffseg.edge_map(typed, EDGES).gradient, ffseg.edge_map(image, EDGES).gradient)
    if kind == "uint16":
        deep = typed[..., ::-1] if rgb else typed
        assert np.array_equal(taken, decode_image(cv2.imencode(".png", deep)[1].tobytes()))


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # of np.matrix, which older programs hand out
def test_a_picture_is_one_however_its_array_lies() -> None:
    wide = np.repeat(np.repeat(DISC, 2, axis=0), 3, axis=1)
    frozen = DISC.copy()
    frozen.flags.writeable = False
    plain = ffseg.segment(DISC, SMALL).mask
    for same in (wide[::2, ::3], DISC[::-1][::-1], np.asfortranarray(DISC), frozen, np.asmatrix(DISC)):
        assert np.array_equal(ffseg.segment(same, SMALL).mask, plain)


def test_a_range_makes_an_image_of_any_numbers(tmp_path: Path) -> None:
    plain, far = ffseg.segment(DISC, SMALL).mask, 400_000_000
    deep, wide = (DISC.astype(np.uint16) * 16, (0, 4080)), (DISC * 100.0 - 7, (-7, 25_493))
    for typed, levels in (deep, wide, (DISC, (0, 9)), (DISC.astype(np.int32) + far, (far, far + 255))):
        found = ffseg.segment(typed, {**SMALL, "input.range": levels})
        assert np.array_equal(found.mask, plain)
        found.save_cutout(tmp_path / "cut.png", typed, levels=levels)
        assert cv2.imread(str(tmp_path / "cut.png"), cv2.IMREAD_UNCHANGED)[..., :3].max() == DISC.max()
        assert np.array_equal(ffseg.edge_map(typed, ffseg.Edges(), levels=levels).edges, LINES.edges)
    for ends in ((5, 5), (np.nan, 1), "x", (1, 2, 3)):
        with pytest.raises(ffseg.SegmentationError, match="black below white"):
            ffseg.edge_map(deep[0], ffseg.Edges(), levels=ends)  # type: ignore[arg-type]
    with pytest.raises(ffseg.ParameterError, match=r"input.range: \[9, 9\] is not .*, ascending and apart"):
        ffseg.segment(DISC / 255, {"input.range": [9, 9]})


def test_everything_that_takes_an_image_is_told_the_order_of_its_colours(tmp_path: Path) -> None:
    picture = np.dstack([DISC, DISC // 2, 255 - DISC])
    result = ffseg.segment(picture, SMALL)
    assert np.array_equal(ffseg.segment(picture[..., ::-1] / 255, SMALL, rgb=True).mask, result.mask)
    for name, order in (("a.png", 1), ("b.png", -1)):
        result.save_overlay(tmp_path / name, picture[..., ::order], rgb=order < 0)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    with ffseg.pick([picture[..., ::-1]], out=tmp_path / "picked", rgb=True):
        assert np.array_equal(ffseg.read_image(tmp_path / "picked" / "images" / "0.png"), picture)
    moving = [np.roll(picture, step, axis=1) for step in range(0, 120, 6)]
    owned = [ffseg.own_image([image[..., ::order] for image in moving], rgb=order < 0) for order in (1, -1)]
    assert np.array_equal(*owned)


def test_masks_may_be_bool_and_files_of_the_parameters_count(tmp_path: Path) -> None:
    left = XX < 60
    Image.fromarray(left.astype(np.uint8) * 255).save(tmp_path / "left.png")
    start = {"init.radius": 8, "init.center": [45, 45]}
    given = ffseg.segment(DISC, start, domain=left)
    named = ffseg.segment(DISC, {**start, "domain.mask": tmp_path / "left.png"})
    assert np.array_equal(given.mask, named.mask)
    assert not named.mask[:, 62:].any()
    with pytest.raises(ffseg.ParameterError, match=r"domain.mask: .*nowhere.png"):
        ffseg.segment(DISC, {"domain.mask": "nowhere.png"})
    with pytest.raises(ffseg.SegmentationError, match="domain must be an array"):
        ffseg.segment(DISC, SMALL, domain=left.astype(float))  # type: ignore[arg-type]


def test_short_texts(result: ffseg.Segmentation) -> None:
    assert re.fullmatch(
        r"<Segmentation of 120 x 90 px: 28\d\d px inside, 1 region, 0 holes; converged after \d+ iterations>",
        repr(result),
    )
    once = ffseg.segment(DISC, {**SMALL, "contour.max_iterations": 1})
    assert repr(once).endswith("max_iterations after 1 iteration>")
    assert re.fullmatch(r"<FreeForm of degree 3: \d+ patches, signed area 28\d\d\.\d px\^2>", repr(result.contours[0]))


@pytest.mark.parametrize(("factor", "size"), [(1, (120, 90)), (6, (360, 270))])
def test_a_notebook_shows_a_picture(factor: int, size: tuple[int, int]) -> None:
    large = ffseg.segment(np.kron(DISC, np.ones((factor, factor), np.uint8)), {"init.radius": 10 * factor})
    picture = Image.open(io.BytesIO(large._repr_png_()))
    assert (picture.size, picture.getpixel((size[0] // 2, size[1] // 2))) == (size, (235, 235, 235))
    assert picture.getpixel((1, 1)) == (70, 70, 70)


def test_files_of_a_result(result: ffseg.Segmentation, tmp_path: Path) -> None:
    result.save_mask(tmp_path / "m.png")
    assert np.array_equal(read_mask(tmp_path / "m.png"), result.mask)
    result.save_svg(tmp_path / "c.svg", title="a & b", behind="of/disc #3 50%.png")
    text = (tmp_path / "c.svg").read_text("utf-8")
    assert "<title>a &amp; b</title>" in text
    assert '<image href="of/disc%20%233%2050%25.png" width="120" height="90"/>' in text
    for suffix in ("png", "jpg", "webp"):
        result.save_overlay(tmp_path / f"o.{suffix}", DISC)
        assert ffseg.read_image(tmp_path / f"o.{suffix}").shape == (90, 120, 3)
    drawn = ffseg.read_image(tmp_path / "o.png")[..., ::-1]
    assert tuple(drawn[45, 60]) == (  # RGB: a quarter of the green of outer contours
        round(0.75 * 210 + 0.25 * 60), round(0.75 * 210 + 0.25 * 220), round(0.75 * 210 + 0.25 * 80),
    )  # fmt: skip
    assert tuple(drawn[1, 1]) == (40, 40, 40)


@pytest.mark.parametrize("image", ["disc.png", DISC * 2.0, DISC[1:], None], ids=["name", "floats", "other", "none"])
def test_an_overlay_needs_the_image(image: typing.Any, result: ffseg.Segmentation, tmp_path: Path) -> None:
    with pytest.raises(ffseg.OutputError, match="needs the image that was segmented"):
        result.save_overlay(tmp_path / "o.png", image)


def test_other_suffixes_and_images_behind_an_svg_are_told_what_goes(result: ffseg.Segmentation, tmp_path: Path) -> None:
    with pytest.raises(ffseg.OutputError, match=r"write one of \.png \(overlay\), \.jpg \(overlay\)"):
        result.save_overlay(tmp_path / "o.tif", DISC)
    with pytest.raises(ffseg.OutputError, match=r"m: there is no suffix; write one of \.png \(mask\)$"):
        result.save_mask(tmp_path / "m")
    with pytest.raises(ffseg.OutputError, match="behind is of type ndarray; give the name of an image file"):
        result.save_svg(tmp_path / "c.svg", behind=DISC)  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


def test_documents_of_a_result(result: ffseg.Segmentation) -> None:
    assert result.to_geojson("disc.png") == geojson_document(annotated_image(result, "disc.png"))
    coco = json.loads(json.dumps(result.to_coco("disc.png")))
    assert coco["images"] == [{"id": 1, "file_name": "disc.png", "width": 120, "height": 90}]
    assert coco["annotations"][0]["area"] == int(result.mask.sum())


def hints(item: object) -> typing.Iterator[object]:
    """Types in the signatures of a public name."""
    if inspect.isclass(item):
        members = [member for name, member in vars(item).items() if not name.startswith("_") or name == "__init__"]
        functions = [getattr(member, "fget", None) or getattr(member, "__func__", member) for member in members]
        yield from typing.get_type_hints(item).values()
    else:
        functions = [item]
    for function in functions:
        if inspect.isfunction(function):
            yield from typing.get_type_hints(function).values()


def classes(hint: object) -> set[type]:
    found = {hint} if isinstance(hint, type) else set()
    for argument in typing.get_args(hint):
        found |= {one for part in (argument if isinstance(argument, list) else [argument]) for one in classes(part)}
    return {one for one in found if one.__module__.startswith("ffseg")}


INTERNAL = {"Section", "TrackedPoints", "Session", "Sighting"}
"""The base of parameter sections, what a ground fit keeps for the structural test, what a picking page is served from, and what
a run's map is fused of: no user makes or asks for them."""


@pytest.mark.parametrize("name", [name for name in ffseg.__all__ if name != "__version__"])
def test_every_type_in_a_public_signature_can_be_had(name: str) -> None:
    found = {one.__name__ for hint in hints(getattr(ffseg, name)) for one in classes(hint)}
    assert found - set(ffseg.__all__) - INTERNAL == set()


def test_strict_type_checking_accepts_the_python_of_the_pages(tmp_path: Path) -> None:
    for page in (ROOT / "README.md", ROOT / "docs" / "tutorial.md"):
        blocks = re.findall(r"^```python\n(.*?)^```$", page.read_text("utf-8"), re.DOTALL | re.MULTILINE)
        assert blocks
        for number, block in enumerate(blocks):
            (tmp_path / f"{page.stem.lower()}_{number}.py").write_text(block, "utf-8")
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file=", "--cache-dir", str(tmp_path / "cache")]
    done = subprocess.run(
        [*command, "--follow-imports=silent", *map(str, sorted(tmp_path.glob("*.py")))],
        capture_output=True, text=True, check=False, cwd=ROOT,
    )  # fmt: skip
    wrong = [line for line in done.stdout.splitlines() if ": error:" in line]
    # stubs are always followed, where the sources are not installed
    assert done.returncode == 0 or (wrong and all(line.startswith("ffseg/") for line in wrong)), done.stdout


@pytest.mark.parametrize(
    ("method", "side", "most"), [("freeform", 65_536, 65_535), ("levelset", 32_768, 32_767), ("snake", 32_768, 32_767)]
)
@pytest.mark.parametrize("wide", [True, False])
def test_a_side_that_no_method_takes_is_said_in_a_sentence(method: str, side: int, most: int, wide: bool) -> None:
    width, height = (side, 16) if wide else (16, side)
    said = f"the image has {width} x {height} pixels, .* takes at most {most} a side; "
    with pytest.raises(ffseg.SegmentationError, match=said):
        ffseg.segment(np.full((height, width), 90, np.uint8), {"init.center": [7, 7], "init.radius": 3}, method=method)


@pytest.mark.parametrize("shape", [(40, 65_535), (65_535, 40)])
def test_the_longest_side_there_may_be_is_segmented(shape: tuple[int, int]) -> None:
    image = np.pad(np.full((shape[0] - 20, shape[1] - 20), 200, np.uint8), 10, constant_values=40)
    found = ffseg.segment(image, {"init.radius": 8})
    assert (found.num_regions, found.num_holes, bool(found.mask[image > 100].mean() > 0.99)) == (1, 0, True)


@pytest.mark.parametrize(
    ("own", "sentence"),
    [
        (lambda scene: None, "returned NoneType; it must return an ffseg.Outcome"),
        (lambda scene: ffseg.Outcome(mask=np.ones(scene.shape)), r"a mask of float64 of shape \(90, 120\); it must be"),
        (lambda scene: ffseg.Outcome(mask=np.ones((9, 9), bool)), r"a mask of bool of shape \(9, 9\); it must be of"),
        (lambda scene: ffseg.Outcome(mask="all"), "a mask of str; it must be of bool or uint8"),
        (lambda scene: ffseg.Outcome((1, 2)), "no tuple of ffseg.FreeForm"),
        (lambda scene: ffseg.Outcome(scene.starts[0]), "no tuple of ffseg.FreeForm"),
        (lambda scene: ffseg.Outcome(), "no tuple of ffseg.FreeForm; give those, or a mask"),
        (lambda scene: ffseg.Outcome(scene.starts, stats=None), "of type NoneType; give ffseg.Stats"),  # type: ignore[arg-type]
    ],
)
def test_what_is_no_outcome_is_refused(own: typing.Callable[[ffseg.Scene], ffseg.Outcome], sentence: str) -> None:
    with pytest.raises(ffseg.ParameterError, match=sentence):
        ffseg.segment(DISC, method=own)


def test_a_mask_of_bytes_is_one() -> None:
    bright = np.where(DISC > 100, np.uint8(255), np.uint8(0))
    found = ffseg.segment(DISC, method=lambda scene: ffseg.Outcome(mask=bright)).mask
    assert found.dtype == np.bool_
    assert np.array_equal(found, bright > 0)


LINES = ffseg.edge_map(DISC, ffseg.Edges())


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"edges": LINES.edges[:-5]}, "the edge map has 120 x 85 pixels, the image 120 x 90"),
        ({"gradient": LINES.gradient[:-5]}, "the edge map has 120 x 85 pixels, the image 120 x 90"),
        ({"edges": LINES.edges > 0}, "edges is bool of shape"),
        ({"edges": LINES.edges // 255}, "255 on edge pixels and 0 elsewhere"),
        ({"gradient": LINES.gradient.astype(">u2")}, "gradient is >u2 of shape"),
        ({"odds": np.zeros(3)}, "odds is float64 of shape"),
        ({"thresholds": None}, "thresholds are None"),
        ({"calibration": (1.0, 3.0)}, "calibration is tuple; give an ffseg.ScoreCalibration"),
    ],
)
def test_an_edge_map_of_something_else_is_refused(changes: dict[str, Any], sentence: str, monkeypatch) -> None:
    own = replace(LINES, **changes)
    monkeypatch.setitem(sys.modules, "own_lines", SimpleNamespace(made=lambda scene: own))
    for params, lines in ((None, own), ({"edges.source": "own_lines:made"}, None)):
        with pytest.raises(ffseg.SegmentationError, match=sentence):
            ffseg.segment(DISC, params, edges=lines)


def test_what_a_contour_found_counts_for_its_own_edges_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wall that a source drew into the map of `auto` was passed over, and so was all else beside a map that was given."""
    seen: list[ffseg.EdgeMap] = []

    def walled(scene: ffseg.Scene) -> ffseg.EdgeMap:
        seen.append(find("evidence", "auto")(scene))
        edges, gradient = seen[0].edges.copy(), seen[0].gradient.copy()
        edges[:, 70], gradient[:, 70] = 255, 60_000
        return replace(seen[0], edges=edges, gradient=gradient)

    monkeypatch.setitem(sys.modules, "own_lines", SimpleNamespace(walled=walled))
    assert not ffseg.segment(DISC, {**SMALL, "edges.source": "own_lines:walled"}).mask[:, 72:].any()
    assert seen[0].trial is not None
    assert ffseg.segment(DISC, {**SMALL, "contour.max_iterations": 1}, edges=seen[0]).stats.iterations == 1


def test_an_edge_map_is_none_of_the_callers_domain() -> None:
    domain = np.ones(DISC.shape, np.uint8)
    found = ffseg.edge_map(DISC, ffseg.Edges(), domain)
    domain[:] = 0
    assert found.domain is not None
    assert found.domain.min() == 255
