"""``ffseg run`` with --export, --animate and --report: what is written, that it fits, and what is refused."""

import base64
import io
import json
import subprocess
import sys
import tarfile
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
import yaml
from bad_images import READS_GIF
from batches import table
from commands import Command
from PIL import Image
from rendered import write_pair

from tests.masks import read_mask, write_image

START = ("--set", "init.radius=12")


@pytest.fixture
def images(tmp_path: Path) -> Path:
    y, x = np.mgrid[0:96, 0:128]
    inside = (np.hypot(x - 64, y - 48) < 38) & (np.hypot(x - 84, y - 48) > 6)
    picture = np.where(inside, 180, 60).astype(np.uint8)
    write_image(tmp_path / "in" / "a.png", picture)
    write_image(tmp_path / "in" / "sub" / "b.png", picture[:, ::-1])
    return tmp_path / "in"


def test_sides_from_1_to_over_4096_pass_every_command(ffseg_command: Command, tmp_path: Path) -> None:
    """Where the prior decides, they crashed after the work was done."""
    shapes = {"dot.png": (1, 1), "wide.png": (9, 4200), "high.png": (4200, 12, 3)}
    for name, shape in shapes.items():
        pixels = np.random.default_rng(2).integers(60, 190, shape)
        write_image(tmp_path / "in" / name, pixels.astype(np.uint8))
        write_image(tmp_path / "in" / f"16-{name}", (pixels * 257).astype(np.uint16))
    way = ("--set", "edges.source=prior", "--set", "init.radius=3")
    kinds = ("--export", "coco,labelme,geojson,yolo,svg,cutout", "--overlay", "--report")
    ffseg_command("run", tmp_path / "in", "--out", tmp_path / "out", *way, *kinds, code=0)
    for name, shape in shapes.items():
        one, other = (read_mask(tmp_path / "out" / "masks" / text) for text in (name, f"16-{name}"))
        assert one.shape == shape[:2]
        np.testing.assert_array_equal(one, other)
    compared = ("--methods", "freeform,levelset", "--repeat", "1", "--json")
    told = ffseg_command("compare", tmp_path / "in", "--out", tmp_path / "table", *way, *compared)
    assert [row["status"] for row in json.loads(told.stdout)["rows"]] == ["ok"] * 12
    for name in shapes:
        ffseg_command("segment", tmp_path / "in" / name, tmp_path / "a.svg", *way, code=0)


def decoded(counts: list[int], size: list[int]) -> np.ndarray:
    values = np.repeat(np.arange(len(counts)) % 2, counts)
    return values.reshape(size, order="F") == 1


LABEL = 'yes: "a horse" \N{HORSE}'
"""Which YAML escapes, in one way and JSON in another."""


def test_yolo_cutouts_and_labels(ffseg_command: Command, images: Path, tmp_path: Path, out: Path) -> None:
    for name in ("drawing.svg", "sub/more.svg", "notes.txt"):
        (images / name).write_text("<svg/>")
    wanted = ("--export", "coco,labelme,geojson,yolo,cutout", "--label", LABEL)
    result = ffseg_command("run", images, "--out", out, *START, *wanted, code=0)
    assert "left out as no images: 3 files of the folders (2 .svg, 1 .txt)" in result.stderr
    mask = cv2.imread(str(out / "masks" / "a.png"), cv2.IMREAD_GRAYSCALE)
    cut = cv2.imread(str(out / "cutouts" / "a.png"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(cut[..., 3], mask)
    np.testing.assert_array_equal(cut[..., 0], np.where(mask, cv2.imread(str(images / "a.png"), 0), 0))
    assert [line.split()[0] for line in (out / "yolo" / "a.txt").read_text().splitlines()] == ["0"]
    assert yaml.safe_load((out / "yolo.yaml").read_text("utf-8")) == {"names": {0: LABEL}}
    assert json.loads((out / "coco.json").read_text())["categories"][0]["name"] == LABEL
    assert json.loads((out / "labelme" / "a.json").read_text())["shapes"][0]["label"] == LABEL
    features = json.loads((out / "geojson" / "a.geojson").read_text())["features"]
    assert features[0]["properties"]["label"] == LABEL
    for name, kind in (("c.png", "cutout"), ("c.webp", "cutout"), ("a.txt", "yolo")):
        ffseg_command("segment", images / "a.png", tmp_path / name, "--as", kind, *START[:2], code=0)
    assert (tmp_path / "a.txt").read_bytes() == (out / "yolo" / "a.txt").read_bytes()
    for name in ("c.png", "c.webp"):
        np.testing.assert_array_equal(cv2.imread(str(tmp_path / name), cv2.IMREAD_UNCHANGED), cut)


@pytest.mark.parametrize(
    ("name", "kind", "sentence"),
    [
        ("c.jpg", "cutout", "the suffix .jpg stands for no output; write one of .png (cutout), .webp (cutout)"),
        ("c.json", "overlay", "the suffix .json stands for no output; write one of .png (overlay), .jpg (overlay)"),
        ("c", "overlay", "there is no suffix; write one of .png (overlay)"),
    ],
)
def test_what_a_file_name_cannot_hold_is_refused(
    name: str, kind: str, sentence: str, ffseg_command: Command, images: Path, tmp_path: Path
) -> None:
    refused = ffseg_command("segment", images / "a.png", tmp_path / name, "--as", kind)
    assert (refused.returncode, sentence in refused.stderr, (tmp_path / name).exists()) == (2, True, False)


@pytest.mark.parametrize(("suffix", "width"), [(".webp", 16384), (".jpg", 65501)])
def test_what_a_format_cannot_hold_is_refused(suffix: str, width: int, ffseg_command: Command, tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "wide.png"), np.zeros((2, width), np.uint8))
    refused = ffseg_command("segment", tmp_path / "wide.png", tmp_path / f"o{suffix}", "--as", "overlay")
    sentence = f"{width}x2 pixels are more than {suffix} holds; write it as .png"
    assert (refused.returncode, sentence in refused.stderr) == (3, True)


@pytest.mark.parametrize("pack", [(), ("--pack", "tar")])
@pytest.mark.parametrize("order", [((), ("--keep-suffix",)), (("--keep-suffix",), ())])
def test_new_names_replace_old(order: tuple, pack: tuple, ffseg_command: Command, images: Path, tmp_path: Path) -> None:
    run = ("run", images, *START, "--export", "coco", *pack, "--out")
    for names in order:
        ffseg_command(*run, tmp_path / "out", *names, code=0)
    ffseg_command(*run, tmp_path / "fresh", *order[1], code=0)
    for folder in ("masks", "coco", "contours"):
        found, fresh = (sorted((tmp_path / out / folder).rglob("*.*")) for out in ("out", "fresh"))
        assert [one.name for one in found] == [one.name for one in fresh]
    assert (tmp_path / "out" / "coco.json").read_bytes() == (tmp_path / "fresh" / "coco.json").read_bytes()


def test_exports_hold_the_mask_and_find_their_image(ffseg_command: Command, images: Path, out: Path) -> None:
    kinds = ("--export", "coco,labelme", "--export", "geojson")
    ffseg_command("run", images, "--out", out, *START, *kinds, code=0)
    for name in ("a", "sub/b"):
        mask = read_mask(out / "masks" / f"{name}.png")
        coco = json.loads((out / "coco" / f"{name}.json").read_text())
        segmentation = coco["annotations"][0]["segmentation"]
        np.testing.assert_array_equal(decoded(segmentation["counts"], segmentation["size"]), mask)
        labelme = out / "labelme" / f"{name}.json"
        image = labelme.parent / json.loads(labelme.read_text())["imagePath"]
        assert image.resolve() == (images / f"{name}.png").resolve()
        (feature,) = json.loads((out / "geojson" / f"{name}.geojson").read_text())["features"]
        assert feature["properties"]["image"] == f"{name}.png"
        assert feature["properties"]["area_px"] == pytest.approx(np.count_nonzero(mask), rel=0.01)
    merged = json.loads((out / "coco.json").read_text())
    assert [image["file_name"] for image in merged["images"]] == ["a.png", "sub/b.png"]
    assert [annotation["image_id"] for annotation in merged["annotations"]] == [1, 2]


def test_labelme_opens_what_has_no_file_of_its_own(ffseg_command: Command, images: Path, out: Path) -> None:
    """It was told to open the tar file or the film."""
    with tarfile.open(images / "all.tar", "w") as tar:
        tar.add(images / "a.png", "a.png")
    (images / "a.png").unlink()
    cv2.imwritemulti(str(images / "pages.tif"), [cv2.imread(str(images / "sub" / "b.png"))] * 2)
    ffseg_command("run", images / "all.tar", images, "--film", "--out", out, *START, "--export", "labelme", code=0)
    for name, place in (("a", "all.tar/a.png"), ("pages_000001", "pages.tif/pages_000001.tif"), ("sub/b", "sub/b.png")):
        document = json.loads((out / "labelme" / f"{name}.json").read_text())
        assert document["imagePath"].endswith(f"in/{place}")
        if name == "sub/b":
            assert document["imageData"] is None
            continue
        shown = cv2.imdecode(np.frombuffer(base64.b64decode(document["imageData"]), np.uint8), cv2.IMREAD_COLOR)
        assert shown.shape[:2] == read_mask(out / "masks" / f"{name}.png").shape


@pytest.mark.parametrize("method", ["freeform", "snake", "levelset"])
def test_films_show_start_to_result(method: str, ffseg_command: Command, images: Path, tmp_path: Path) -> None:
    plain, out = tmp_path / "plain", tmp_path / "out"
    settings = (*START, "--set", f"method={method}")
    ffseg_command("run", images, "--out", plain, *settings, code=0)
    ffseg_command("run", images, "--out", out, *settings, "--animate", code=0)
    with Image.open(out / "animations" / "sub" / "b.webp") as film:
        assert film.size == (128, 96)
        assert film.n_frames >= 2
    strip = ElementTree.fromstring((out / "animations" / "a.svg").read_bytes())  # noqa: S314 - our own text
    captions = [text for text in strip.itertext() if text.startswith("iteration")]
    assert captions[0] == "iteration 0"
    assert len(captions) >= 2
    assert len(set(captions)) == len(captions), "the result is shown once"
    for kind in ("masks/a.png", "contours/sub/b.svg"):  # being watched changes no byte
        assert (out / kind).read_bytes() == (plain / kind).read_bytes()


def test_views_are_filmed_and_exported_too(ffseg_command: Command, tmp_path: Path, out: Path) -> None:
    write_pair(tmp_path)
    camera = ("--camera", tmp_path / "camera.yaml", "--poses", tmp_path / "poses.csv")
    ffseg_command("run", tmp_path / "views", "--out", out, *camera, "--export", "geojson", "--animate", code=0)
    (region,) = json.loads((out / "geojson" / "2.geojson").read_text())["features"]
    area = np.count_nonzero(read_mask(out / "masks" / "2.png"))
    assert region["properties"]["area_px"] == pytest.approx(area, rel=0.01)
    with Image.open(out / "animations" / "2.webp") as film:
        assert film.n_frames > 5


def test_an_unwritable_report_is_a_problem_and_no_loss(ffseg_command: Command, images: Path, tmp_path: Path) -> None:
    (tmp_path / "out" / "report.html").mkdir(parents=True)
    result = ffseg_command("run", images, "--out", tmp_path / "out", *START, "--report", "--overwrite", code=3)
    assert "report.html" in result.stderr
    assert "Traceback" not in result.stderr
    assert (tmp_path / "out" / "masks" / "a.png").is_file()


def test_films_without_pillow_are_refused_by_name(images: Path, tmp_path: Path) -> None:
    code = (
        "import sys; from importlib import util; from ffseg.__main__ import main; found = util.find_spec\n"
        "util.find_spec = lambda name, *rest: None if name == 'PIL' else found(name, *rest)\n"
        f"sys.argv = ['ffseg', 'run', {str(images)!r}, '--out', {str(tmp_path / 'out')!r}, '--animate']; main()"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert result.returncode == 2
    assert "ffseg[film]" in result.stderr
    assert not (tmp_path / "out").exists()


def test_svg_export_has_the_image_behind_the_contours(ffseg_command: Command, images: Path, tmp_path: Path) -> None:
    ffseg_command("run", images, "--out", tmp_path / "out", *START, "--export", "svg", code=0)
    namespace = "{http://www.w3.org/2000/svg}"
    drawing, plain = (
        ElementTree.fromstring((tmp_path / "out" / folder / "sub" / "b.svg").read_text())  # noqa: S314 - our own file
        for folder in ("svg", "contours")
    )
    title, picture, *paths = drawing
    assert title.text == "sub/b.png"
    assert (picture.tag, picture.get("width"), picture.get("height")) == (f"{namespace}image", "128", "96")
    head, _, data = (picture.get("href") or "").partition(",")
    assert head == "data:image/jpeg;base64"
    stored = np.asarray(Image.open(images / "sub" / "b.png")).astype(int)
    assert np.abs(np.asarray(Image.open(io.BytesIO(base64.b64decode(data)))) - stored).mean() < 2  # levels 60 and 180
    assert [path.get("d") for path in paths] == [path.get("d") for path in plain.iter(f"{namespace}path")]


def test_the_row_of_a_stack_says_that_one_page_was_read(ffseg_command: Command, images: Path, tmp_path: Path) -> None:
    page = Image.open(images / "a.png")
    page.save(images / "stack.tif", save_all=True, append_images=[page])
    page.convert("P").save(images / "film.gif", save_all=True, append_images=[Image.new("P", page.size)])
    if not READS_GIF:
        (images / "film.gif").unlink()
    ffseg_command("run", images, "--out", tmp_path / "out", *START, code=0)
    notes = {row["image"]: row["note"] for row in table(tmp_path / "out" / "timings.csv") if row["note"]}
    film = (
        {"film.gif": "only the first frame was read; the GIF file has more: ffseg run --film takes all"}
        if READS_GIF
        else {}
    )
    assert notes == {
        "stack.tif": "only the first page was read; the TIFF file has more: ffseg run --film takes all",
        **film,
    }


def test_the_summary_says_iou_and_what_stopped(ffseg_command: Command, images: Path, tmp_path: Path, out: Path) -> None:
    y, x = np.mgrid[0:96, 0:128]
    for name in ("a.png", "sub/b.png"):
        write_image(tmp_path / "truth" / name, np.hypot(x - 64, y - 48) < 38)
    given = ("run", images, "--out", out, *START, "--truth", tmp_path / "truth", "--set", "contour.max_iterations=1")
    shown = ffseg_command(*given, code=0)
    overlaps = [float(row["iou"]) for row in table(out / "timings.csv")]
    assert len(overlaps) == 2
    lines = dict(line.split(maxsplit=1) for line in shown.stdout.replace("mean IoU", "mean-IoU").splitlines() if line)
    assert lines["mean-IoU"] == f"{np.mean(overlaps):.4f} (lowest {min(overlaps):.4f}, of 2)"
    assert lines["doubtful"] == "2 stopped before they had converged; of 2"
    document = json.loads(ffseg_command(*given, "--json").stdout)
    assert document["mean_iou"] == pytest.approx(np.mean(overlaps), abs=1e-12)
    assert document["max_iterations"] == 2
