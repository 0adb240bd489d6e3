"""Make the pictures of the documentation from the project's own samples: ``python docs/make_pictures.py [NAME]...``.

Without names, all of them. The page of a report is photographed where a Chromium is installed, and left as it is elsewhere.
"""

from __future__ import annotations

import re
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import ffseg
from ffseg.camera.motion import planar_pose
from ffseg.freespace.sequence import Sequence
from ffseg.io.animation import animation_bytes
from ffseg.io.overlays import Kind, Polyline, draw_overlay
from ffseg.io.snapshots import scaled_contour, scaled_down
from ffseg.io.strip import film_strip_svg
from ffseg.rendering.pairs import render_pair
from ffseg.samples import texture
from ffseg.samples.drive import drive, drive_camera
from ffseg.samples.paint import SampleGrid, coverage
from ffseg.samples.scenes import SCENES

FOLDER = Path(__file__).resolve().parent / "images"
Image = NDArray[np.uint8]
Settings = Mapping[str, Any]
GROUND_SEED = 3
"""Any rendered scene would do; this one has marks and boxes in plain sight."""
PANEL = 380
"""px, width of one panel."""
GALLERY = 760
"""px, width of a picture of the gallery."""
SHOWN = re.compile(r"<!-- from (\S+) -->\n!\[[^]]*\]\(images/([\w-]+)\.webp\)")
"""A file that a block of the gallery writes, and the name of its picture."""


def sample(name: str) -> Image:
    """A sample image as grey or BGR."""
    image = SCENES[name]().image
    return image if image.ndim == 2 else np.ascontiguousarray(image[..., ::-1])


def iou(mask: NDArray[np.bool_], truth: NDArray[np.bool_]) -> float:
    """Intersection over union."""
    return float((mask & truth).sum() / (mask | truth).sum())


def drawn(image: Image, result: ffseg.Segmentation, factor: int = 1) -> Image:
    """The image in the width of a panel, or enlarged by whole pixels, with the contours on it."""
    if factor == 1:
        canvas, scale = scaled_down(image, PANEL)
    else:
        canvas, scale = np.repeat(np.repeat(image, factor, axis=0), factor, axis=1), float(factor)
    lines = [
        Polyline(scaled_contour(c, scale).flatten(0.1), "outer" if c.signed_area > 0 else "obstacle")
        for c in result.contours
    ]
    return draw_overlay(np.ascontiguousarray(canvas), lines)


def captioned(panel: Image, caption: str) -> Image:
    """A panel of the common width with a line of text below it."""
    height = round(panel.shape[0] * PANEL / panel.shape[1])
    small = cv2.resize(panel, (PANEL, height), interpolation=cv2.INTER_AREA)
    line = np.full((30, PANEL, 3), 255, np.uint8)
    cv2.putText(line, caption, (4, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.47, (30, 30, 30), 1, cv2.LINE_AA)
    return np.vstack([small, line])


def side_by_side(name: str, panels: list[Image]) -> None:
    """Write panels in one row."""
    gap = np.full((panels[0].shape[0], 8, 3), 255, np.uint8)
    webp(name, np.hstack([piece for panel in panels for piece in (panel, gap)][:-1]))


def webp(name: str, picture: Image) -> None:
    """Write a picture as WebP."""
    done, data = cv2.imencode(".webp", picture, [cv2.IMWRITE_WEBP_QUALITY, 82])
    assert done  # noqa: S101 - a picture of our own making
    write(f"{name}.webp", data.tobytes())


def write(name: str, data: bytes) -> None:
    """Write one picture and say how large it is."""
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / name).write_bytes(data)
    print(f"{name}: {len(data) / 1000:.0f} kB")


def with_settings(
    name: str, scene: str, cases: Mapping[str, Settings], crop: tuple[int, int, int, int] | None = None
) -> None:
    """One sample under several settings, each with its IoU and its holes in the caption."""
    image, truth = sample(scene), SCENES[scene]().truth > 0
    panels = []
    for label, settings in cases.items():
        result = ffseg.segment(image, ffseg.load_params(None, settings))
        holes = sum(contour.signed_area < 0 for contour in result.contours)
        panel = drawn(image, result, 1 if crop is None else 8)
        if crop is not None:
            x0, y0, x1, y1 = (8 * value for value in crop)
            panel = panel[y0:y1, x0:x1]
        panels.append(
            captioned(np.ascontiguousarray(panel), f"{label}: IoU {iou(result.mask, truth):.4f}, {holes} holes")
        )
    side_by_side(name, panels)


def rooms() -> None:
    """Two rooms and a door of 20 px, with and without clearance."""
    paper = SampleGrid(400, 240)
    doorway = paper.polygon([(150, 110), (260, 110), (260, 130), (150, 130)])
    free = coverage(paper.ellipse((105, 120), (85, 95)) | paper.ellipse((300, 120), (80, 95)) | doorway)
    image = texture.to_bytes(texture.softened(70 + 110 * free) + texture.grain((240, 400), 3.0, 7))
    panels = []
    for width in (0, 30):
        settings = {"contour.clearance": width, "init.center": [105, 120], "init.radius": 30}
        panels.append(
            captioned(drawn(image, ffseg.segment(image, ffseg.load_params(None, settings))), f"clearance: {width}")
        )
    side_by_side("clearance", panels)


def ground() -> None:
    """A rendered pair under a mirror: enclosed components before and after the test of their altitude."""
    pair = render_pair(GROUND_SEED)
    sequence = Sequence(pair.camera, ffseg.load_params())
    before, pose = (planar_pose(pair.camera, *values) for values in pair.poses)
    sequence.feed(pair.previous.image, before)
    frame = sequence.feed(pair.current.image, pose)
    image, scale = scaled_down(pair.current.image, PANEL)

    def lines(contours: Iterable[ffseg.FreeForm], inner: Kind) -> list[Polyline]:
        return [
            Polyline(scaled_contour(c, scale).flatten(0.1), "outer" if c.signed_area > 0 else inner) for c in contours
        ]

    first = draw_overlay(image, lines(frame.segmentation.contours, "obstacle"))
    judged = draw_overlay(image, lines(frame.contours, "obstacle") + lines(frame.merged_contours, "false"))
    caption = f"after the test: {len(frame.merged_contours)} marks given back (blue)"
    side_by_side("ground", [captioned(first, "enclosed components of one image"), captioned(judged, caption)])


def driven() -> None:
    """The sample drive without poses: what the mirror shows, and the map as it grows, with its ways at the end."""
    from PIL import Image as Pictures

    views = drive().views
    sequence, full = Sequence(drive_camera()), ffseg.OccupancyMap()
    grid = ffseg.OccupancyMap(reach=1.7)  # a short reach, so that it can be seen to grow
    shots = []
    for view in views:
        frame = sequence.feed(view.image)
        grid.add(frame)
        full.add(frame)
        lines = [Polyline(c.flatten(0.1), "outer" if c.signed_area > 0 else "obstacle") for c in frame.contours]
        lines += [Polyline(c.flatten(0.1), "false") for c in frame.merged_contours]
        shots.append((draw_overlay(view.image, lines)[:, 40:280], grid.probability, grid.origin, len(shots) + 1))
    ways = [edge.points for edge in grid.skeleton(0.15).edges]
    pages = [film_page(grid, shot, ways if shot is shots[-1] else []) for shot in shots]
    pictures = [Pictures.fromarray(np.ascontiguousarray(page[..., ::-1])) for page in pages]
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / "drive.webp"
        pace = [150] * (len(pictures) - 1) + [4000]
        pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=pace, loop=0, quality=50, method=6)
        write(path.name, path.read_bytes())
    whole = cv2.imdecode(np.frombuffer(full.picture(full.skeleton(0.15)), np.uint8), cv2.IMREAD_COLOR)
    write("drive-map.webp", cv2.imencode(".webp", whole, [cv2.IMWRITE_WEBP_QUALITY, 80])[1].tobytes())


def film_page(grid: ffseg.OccupancyMap, shot: tuple[Image, Any, tuple[float, float], int], ways: list[Any]) -> Image:
    """The mirror and the map of one frame, the map at its place in that of the whole drive."""
    mirror, chance, origin, count = shot
    whole = np.full(grid.probability.shape, 0.5)
    column, row = (round((own - first) / grid.cell) for own, first in zip(origin, grid.origin, strict=True))
    whole[row : row + chance.shape[0], column : column + chance.shape[1]] = chance
    rows, columns = np.nonzero(grid.probability != 0.5)
    low, high = np.array([columns.min(), rows.min()]) - 4, np.array([columns.max(), rows.max()]) + 5
    grey = np.rint(255.0 * (1.0 - whole[low[1] : high[1], low[0] : high[0]][::-1])).astype(np.uint8)
    large = np.repeat(np.repeat(grey, 3, axis=0), 3, axis=1)

    def line(points: NDArray[np.float64], kind: Kind) -> Polyline:
        place = ((points - grid.origin) / grid.cell - low) * 3 - 0.5
        there = np.stack([place[:, 0], len(large) - 1 - place[:, 1]], axis=1)
        return Polyline(np.concatenate([there, there[::-1]]), kind)

    stations = [one for one in grid.stations[:count] if one is not None]
    way = np.array([[one.x, one.y] for one in stations])
    panel = draw_overlay(large, [*(line(points, "false") for points in ways), line(way, "differs")])
    side = round(mirror.shape[1] * len(panel) / mirror.shape[0])
    return np.hstack([cv2.resize(mirror, (side, len(panel)), interpolation=cv2.INTER_CUBIC), panel])


def snapshots(scene: str, source: str | None, settings: Settings | None = None) -> tuple[Image, list[Any]]:
    """Snapshots of one evolution."""
    image, seen = sample(scene), list[Any]()
    ffseg.segment(image, ffseg.load_params(source, settings), callback=seen.append)
    return image, seen


def result() -> None:
    """The first picture of the README: the contour grows over the complex sample."""
    image, seen = snapshots("complex", None)
    write("result.webp", animation_bytes(image, seen, "webp", 640))


def toy() -> None:
    """The paper's toy figure: fixed patches, refinement, refinement and topology changes."""
    for preset, settings in (("toy-fixed", None), ("toy-refined", {"contour.max_iterations": 60}), ("toy-full", None)):
        image, seen = snapshots("toy", preset, settings)
        write(f"{preset}.webp", animation_bytes(image, seen, "webp", 400))
        write(f"{preset}.svg", film_strip_svg(image, seen, 5, preset).encode("utf-8"))


def toy_paper() -> None:
    """The same by the printed method; refinement alone is stopped while it loops round the holes."""
    panels, truth = [], SCENES["toy"]().truth > 0
    for label, preset in (("fixed", "toy-fixed"), ("refined", "toy-refined"), ("flips", "toy-full")):
        params = ffseg.load_params(
            preset, {"method": "paper", "contour.max_iterations": 250 if label != "refined" else 110}
        )
        found = ffseg.segment(sample("toy"), params)
        caption = f"{label}: IoU {iou(found.mask, truth):.3f}, {found.stats.iterations} iterations"
        panels.append(captioned(drawn(sample("toy"), found), caption))
    side_by_side("toy-paper", panels)


def report() -> None:
    """The report page of a run over the samples, photographed."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
    import chromium
    import runs

    from ffseg.batch.report.write import write_report

    program = chromium.find()
    if program is None:
        print("report.webp, report-image.webp: left as they are, no Chromium found")
        return
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "out"
        failure = ("cut.png", "truncated: the PNG data ends before the image does; copy the file again")
        runs.sample_run(folder, failures=[failure])
        with chromium.Chromium(program, Path(temporary) / "profile", (1200, 900)) as tab:
            tab.open(write_report(folder).as_uri())
            tab.until("document.querySelectorAll('#sheet img').length === 3")
            tab.value(f"document.getElementById('title').textContent = {folder.name!r}")
            photograph(tab, "report")
            tab.value("document.querySelector('#sheet .card:not(.failed)').click()")
            tab.until("document.querySelectorAll('#layers .part').length > 3")
            box = tab.value("document.querySelectorAll('#layers .hole')[1].getBoundingClientRect().toJSON()")
            tab.hover(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
            time.sleep(0.5)
            photograph(tab, "report-image")


def photograph(tab: Any, name: str) -> None:  # noqa: ANN401 - the tests' browser
    """Write what a tab shows as WebP."""
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / "shot.png"
        tab.screenshot(path)
        webp(name, cv2.imread(str(path)))


def alike() -> None:
    """Of a picture of many things what a click finds, and all that look like it."""
    sys.path.insert(0, str(FOLDER.parents[1]))
    from tests.campaigns.all_things import ellipses
    from tests.many_things import deepest

    image, truth = ellipses(3)
    one = {"init.circles": [deepest(truth)]}
    cases = {"a click": one, "all that look alike": {**one, "region.islands": "all"}}
    side_by_side("alike", [captioned(drawn(image, ffseg.segment(image, more)), name) for name, more in cases.items()])


def gallery() -> None:
    """Run what the gallery shows, as it stands there; each picture is the file that the comment above it names."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
    import documented_blocks as documented

    page = FOLDER.parent / "gallery.md"
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        environment = documented.prepare(folder, page, Path(sys.executable).parent)
        for block in documented.blocks(page):
            wrong = documented.run(block, "bash", folder, environment)
            if wrong:
                raise SystemExit(f"{page.name}: {wrong}")
        for source, name in SHOWN.findall(page.read_text("utf-8")):
            webp(name, scaled_down(cv2.imread(str(folder / source)), GALLERY)[0])


PICTURES: dict[str, Callable[[], None]] = {
    "result": result,
    "toy": toy,
    "toy-paper": toy_paper,
    "report": report,
    "gallery": gallery,
    "alike": alike,
    "canny": lambda: with_settings(
        "canny",
        "complex",
        {
            "canny: [6, 12]": {"edges.canny": [6, 12]},
            "auto": {},
            "canny: [90, 180]": {"edges.canny": [90, 180]},
        },
    ),
    "sigma": lambda: with_settings(
        "sigma",
        "complex",
        {f"sigma: {sigma}": {"edges.sigma": sigma, "edges.source": "gradient"} for sigma in (1.5, 4.0, 8.0)},
    ),
    "rooms": rooms,
    "ground": ground,
    "drive": driven,
    "start": lambda: with_settings(
        "start",
        "complex",
        {
            "center: [420, 300], radius: 40": {"init.center": [420, 300], "init.radius": 40},
            "center: [620, 200], radius: 15": {"init.center": [620, 200], "init.radius": 15},
        },
    ),
    "closing": lambda: with_settings(
        "closing",
        "simple",
        {
            "balloon: 4": {},
            "balloon: -4, box": {"contour.balloon": -4, "init.boxes": [[10, 10, 790, 590]]},
        },
    ),
    "settle": lambda: with_settings(
        "settle",
        "simple",
        {f"settle: {width}": {"contour.settle": width} for width in (0, 4)},
        crop=(545, 190, 605, 235),
    ),
    "degree": lambda: with_settings(
        "degree",
        "simple",
        {
            f"degree: {degree}": {"contour.degree": degree, "contour.refine": False, "contour.patches": 14}
            for degree in (1, 2, 3)
        },
    ),
}


def main() -> int:
    """Make the pictures that are named, or all."""
    unknown = [name for name in sys.argv[1:] if name not in PICTURES]
    if unknown:
        print(f"no picture {', '.join(unknown)}; there are {', '.join(PICTURES)}", file=sys.stderr)
        return 2
    for name in sys.argv[1:] or PICTURES:
        PICTURES[name]()
    return 0


if __name__ == "__main__":
    sys.exit(main())
