"""Starts files: what is read and matched, what is refused by line, and that runs and comparisons start there."""

import cProfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from batches import run_plan, table
from hypothesis import given
from hypothesis import strategies as st

import ffseg
from ffseg.batch.plan.jobs import make_plan, with_starts
from ffseg.batch.record.ledger import Summary
from ffseg.batch.workers.messages import Setup
from ffseg.compare.run import compare, plan_comparison
from ffseg.compare.values import Comparison
from ffseg.enlargement import smaller
from ffseg.errors import FfsegError, ParameterError
from ffseg.geometry.orientation import ring_area
from ffseg.image.outlines import outlines
from ffseg.io.starts import Start, check_starts, finds_starts, load_starts, starts_table
from ffseg.methods.peers import PEERS
from ffseg.metrics import iou
from ffseg.parameter_files import load_params
from ffseg.parameters import MIN_START_RADIUS, Parameters
from ffseg.peer_parameters import PeerParameters
from ffseg.schema.strict_csv import MAX_BYTES
from tests.discs import LEFT, RIGHT, disc_of, overlap, two_discs
from tests.masks import read_mask, write_image


def write(folder: Path, text: str | bytes) -> Path:
    path = folder / "starts.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_rows_are_found_by_name_or_stem_in_any_order(tmp_path: Path) -> None:
    path = write(tmp_path, "image,x,y,radius\nother.png,1,1,1\nsub/b,3,4.5,\na.png,1,2,7\n")
    assert load_starts(path, ["a.png", "sub/b.jpg"]) == {"a.png": Start(1, 2, 7), "sub/b.jpg": Start(3, 4.5)}
    assert load_starts(path, ["a.png", "a.png.jpg"]) == {"a.png": Start(1, 2, 7)}, "an exact name is of no other image"


@pytest.mark.parametrize(
    ("text", "name"),
    [("\ufeffimage, x, y\r\n\r\na , 1 , 2\r\n", "a.png"), ("image,x,y\n\\xff.png,1,2\n", "\udcff.png")],
)
def test_radii_may_be_absent_and_names_are_as_tables_write_them(text: str, name: str, tmp_path: Path) -> None:
    assert load_starts(write(tmp_path, text), [name]) == {name: Start(1, 2)}


BAD = {
    "header": ("image,seed_x,seed_y\na,1,2\n", r"starts\.csv:1: the header must be image,x,y or image,x,y,radius"),
    "empty": ("", r"starts\.csv:1: the header must be"),
    "columns": ("image,x,y\n\na,1\n", r"starts\.csv:3: 2 columns, must be 3: image,x,y"),
    "too many": ("image,x,y\na,1,2,3\n", r":2: 4 columns, must be 3"),
    "word": ("image,x,y\na,1,2\nb,one,2\n", r":3: x: 'one' is not a finite number"),
    "nan": ("image,x,y\na,1,nan\n", r":2: y: 'nan'"),
    "infinite": ("image,x,y\na,1,1e999\n", r":2: y: '1e999'"),
    "grouped": ("image,x,y\na,1_0,2\n", r":2: x: '1_0'"),
    "empty cell": ("image,x,y\na,,2\n", r":2: x: ''"),
    "no radius": ("image,x,y,radius\na,1,2,0\n", r":2: radius: 0 is not above 0"),
    "negative": ("image,x,y,radius\na,1,2,-3\n", r":2: radius: -3 is not above 0"),
    "word radius": ("image,x,y,radius\na,1,2,big\n", r":2: radius: 'big'"),
    "no name": ("image,x,y\n,1,2\n", r":2: image: the name is empty"),
    "twice": ("image,x,y\na,1,2\na,3,4\na,1,2\n", r":4: 'a' has this start already; keep one row"),
    "two names": ("image,x,y\na,1,2\na.png,3,4\n", r"lines 3 \('a.png'\) and 2 \('a'\) both name the image 'a.png'"),
    "quote": ('image,x,y\n"a,1,2\n', r":2: not valid CSV"),
    "nul": ("image,x,y\na,1,\0\n", r":2: "),
    "latin": (b"image,x,y\na\xe9,1,2\n", r":2: not UTF-8"),
    "large": (b"image,x,y\n" + b"a" * MAX_BYTES, r"larger than"),
    "no row": ("image,x,y\nb.png,1,2\n", r"no row for the image 'a.png' \(line 2 has 'b.png'\); add one"),
    "only a header": ("image,x,y\n", r"no row for the image 'a.png'; add one"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_are_refused_by_line(name: str, tmp_path: Path) -> None:
    text, said = BAD[name]
    with pytest.raises(ParameterError, match=said) as caught:
        load_starts(write(tmp_path, text), ["a.png"])
    assert str(caught.value).startswith(str(tmp_path / "starts.csv"))


def test_a_file_need_not_name_every_image(tmp_path: Path) -> None:
    """One photograph without a row kept a whole folder from being run."""
    path = write(tmp_path, "image,x,y\nhorse.jpg,1,2\nzebra.jpg,5,5\n")
    assert load_starts(path, ["horse.jpg", "IMG_0001.jpg"]) == {"horse.jpg": Start(1, 2)}
    with pytest.raises(ParameterError, match=r"no row for the image 'zebras.jpg' \(line 3 has 'zebra.jpg'\)"):
        load_starts(path, ["horse.jpg", "zebras.jpg"])
    with pytest.raises(ParameterError, match="no row for the image 'IMG_0001.jpg'; add one"):
        load_starts(path, ["IMG_0001.jpg"])


def test_a_folder_and_an_absent_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="not a regular file"):
        load_starts(tmp_path, ["a"])
    with pytest.raises(ParameterError, match="cannot be read"):
        load_starts(tmp_path / "none.csv", ["a"])


@given(st.binary(max_size=80))
def test_any_bytes_are_starts_or_an_error(tmp_path_factory: pytest.TempPathFactory, tail: bytes) -> None:
    path = write(tmp_path_factory.mktemp("any"), b"image,x,y,radius\na," + tail)
    try:
        found = load_starts(path, ["a"])["a"]
    except FfsegError as error:
        assert str(path) in str(error)
    else:
        assert np.isfinite([found.x, found.y, found.radius or 1]).all()


@pytest.mark.parametrize("own", [{"init.circles": [[1, 2, 3]]}, {"init.boxes": [[1, 2, 3, 4]]}, {"init.mask": "m"}])
def test_other_kinds_of_starts_are_refused_by_key(own: dict[str, object]) -> None:
    with pytest.raises(ParameterError, match=rf"s\.csv gives .*, but {next(iter(own))} is set too"):
        check_starts(load_params(None, own), "s.csv")
    check_starts(load_params(None, {"init.center": [1, 2]}), "s.csv")


def test_several_rows_of_an_image_are_several_circles(tmp_path: Path) -> None:
    path = write(tmp_path, "image,x,y,radius\na,1,2,7\nb,5,5,\na,3,4,\n")
    found = load_starts(path, ["a.png", "b.png"])
    assert (found["a.png"], found["b.png"]) == (Start(1, 2, 7, (Start(3, 4),)), Start(5, 5))
    params = load_params(None, {"init.radius": 9})
    assert found["a.png"].placed(params, (60, 80)).init.circles == ((1, 2, 7), (3, 4, 9))
    assert found["b.png"].placed(params, (60, 80)).init.circles == ()
    assert len({Start(1, 2, 7).text(), found["a.png"].text(), Start(3, 4, None, (Start(1, 2, 7),)).text()}) == 3


@pytest.mark.parametrize("name", ["a", "a{}"])
def test_work_is_in_proportion_to_the_rows(name: str, tmp_path: Path) -> None:
    counts = []
    for rows in (200, 800):
        names = [name.format(row) for row in range(rows)]
        text = "".join(f"{one},{row},2\n" for row, one in enumerate(names))
        path = write(tmp_path, f"image,x,y\n{text}")
        with cProfile.Profile() as profile:
            load_starts(path, names)
        counts.append(sum(entry.callcount for entry in profile.getstats()))
    assert counts[1] < 4.1 * counts[0]  # equal circles were looked for one by one: 16 times the calls


def test_a_start_without_a_radius_leaves_it() -> None:
    params, moved = (load_params(None, {"init.radius": 9, "init.center": center}) for center in ([5, 5], [1, 2]))
    assert Start(1, 2).placed(params, (60, 80)).init == moved.init
    assert Start(1, 2, 3).placed(params, (60, 80)).init.radius == 3


def run_from(folder: Path, text: str, out: Path, params: Parameters) -> Summary:
    plan = with_starts(make_plan([str(folder)], str(out)), str(write(folder.parent, text)))
    return run_plan(plan, Setup(params=params))


def mask_of(out: Path, name: str) -> np.ndarray:
    return read_mask(out / "masks" / name)


def test_a_run_starts_each_image_at_its_own_place_and_redoes_changed_starts(tmp_path: Path) -> None:
    two_discs(tmp_path / "in", "a.png", "b.png")
    params, out = load_params(None, {"init.radius": 6}), tmp_path / "out"
    first = "image,x,y,radius\na,30,40,\nb,90,40,8\n"
    assert run_from(tmp_path / "in", first, out, params).done == 2
    a, b = mask_of(out, "a.png"), mask_of(out, "b.png")
    assert (a[LEFT[::-1]], a[RIGHT[::-1]], b[LEFT[::-1]], b[RIGHT[::-1]]) == (True, False, False, True)
    starts = [[row[f"start_{key}"] for key in ("x", "y", "radius")] for row in table(out / "timings.csv")]
    assert starts == [["30.0", "40.0", "6.0"], ["90.0", "40.0", "8.0"]]
    assert run_from(tmp_path / "in", first, out, params).unchanged == 2
    assert run_from(tmp_path / "in", "image,x,y\nb,90,40\na,30,40\n", out, params).done == 1  # b has another radius
    changed = run_from(tmp_path / "in", "image,x,y\nb,90,40\na,90,40\n", out, params)
    assert (changed.unchanged, changed.done) == (1, 1)
    assert np.array_equal(mask_of(out, "a.png"), mask_of(out, "b.png"))


def test_a_run_without_starts_does_the_images_again(tmp_path: Path) -> None:
    two_discs(tmp_path / "in", "a.png")
    params, out = load_params(None, {"init.center": [30, 40], "init.radius": 6}), tmp_path / "out"
    run_from(tmp_path / "in", "image,x,y\na,90,40\n", out, params)
    assert run_plan(make_plan([str(tmp_path / "in")], str(out)), Setup(params=params)).done == 1
    assert mask_of(out, "a.png")[LEFT[::-1]]
    assert "start_x" not in table(out / "timings.csv")[0]


def test_a_start_outside_its_image_costs_that_image(tmp_path: Path) -> None:
    two_discs(tmp_path / "in", "a.png", "b.png")
    params = load_params(None, {"init.radius": 6})
    summary = run_from(tmp_path / "in", "image,x,y\na,30,40\nb,300,40\n", tmp_path / "out", params)
    assert (summary.done, summary.failed) == (1, 1)
    assert "(300, 40)" in table(tmp_path / "out" / "timings.csv")[1]["error"]


def test_every_method_and_peer_is_given_the_same_start(tmp_path: Path) -> None:
    two_discs(tmp_path / "in", "a.png", "b.png")
    truths, disc = tmp_path / "truth", disc_of((80, 120))
    write_image(truths / "a.png", disc(*LEFT, 19.99))
    write_image(truths / "b.png", disc(*RIGHT, 19.99))
    starts = write(tmp_path, "image,x,y,radius\na,30,40,6\nb,90,40,6\n")
    jobs = plan_comparison([str(tmp_path / "in")], str(tmp_path / "out"), str(truths), str(starts))
    grown = ("cv_floodfill", "cv_edges", "cv_edges_opened", "cv_watershed", "skfmm", "sitk_fast_marching", "sitk_gac")
    methods = ("freeform", "snake", "levelset", *(name for name in grown if PEERS[name].installed))
    rows = compare(Comparison(jobs, str(tmp_path / "out"), methods, load_params(), PeerParameters()), lambda _row: None)
    assert {(row.image, row.method): row.status for row in rows if row.status != "ok"} == {}
    # Another start would fill the other disc or the ground: the overlap would be 0. The watershed ends a pixel inside.
    assert min(row.iou or 0 for row in rows) > 0.85, rows


def test_images_that_cannot_be_tried_need_no_start(tmp_path: Path) -> None:
    two_discs(tmp_path, "a.png")
    long = tmp_path / ("n" * 254)
    long.write_bytes((tmp_path / "a.png").read_bytes())
    plan = make_plan([str(tmp_path / "a.png"), str(long)], str(tmp_path / "out"))
    assert [bool(job.source.problem) for job in plan.jobs] == [False, True]
    started = with_starts(plan, str(write(tmp_path, "image,x,y\na,1,2\n")))
    assert [job.start for job in started.jobs] == [Start(1, 2), None]


def test_other_kinds_of_rows_are_what_was_picked_and_are_written_as_they_are_read(tmp_path: Path) -> None:
    head = "image,kind,x,y,radius,right,bottom,value"
    a = "a,start,1,2,7,,,\na,start,3,4,,,,\na,not,5,6,,,,\na,not,7,8,2,,,1\na,box,1,2,,30,40,\n"
    path = write(tmp_path, f"{head}\n{a}b,probability,,,,,,.3\nb,clearance,,,,,,5\nb,model,,,,,,\nb,alike,,,,,,\n")
    found = load_starts(path, ["a", "b"])
    background = ((5.0, 6.0), (7.0, 8.0, 2.0, 1.0))
    assert found["a"] == Start(1, 2, 7, (Start(3, 4),), background, ((1.0, 2.0, 30.0, 40.0),))
    assert found["b"] == Start(probability=0.3, clearance=5, alike=True, found=True)
    assert load_starts(write(tmp_path, starts_table(found)), ["a", "b"]) == found
    params = load_params(None, {"init.background": [[9, 9]]})
    placed = found["a"].placed(params, (60, 80))
    assert placed.init.circles == ((1, 2, 7), (3, 4, MIN_START_RADIUS)), "one of several is a click"
    assert placed.init.background == ((9, 9), *background)
    placed = found["b"].placed(params, (60, 80))
    assert (placed.region.probability, placed.contour.clearance, placed.init) == (0.3, 5, params.init)
    assert (placed.region.islands, placed.edges.source) == ("all", "alike")
    modelled = replace(params, edges=replace(params.edges, model="a.ffmodel"))
    assert replace(found["b"], x=1, y=2).placed(modelled, (60, 80)).edges.model is None, "what is picked counts"
    placed = replace(found["b"], alike=False).placed(params, (60, 80))
    assert (placed.region.islands, placed.edges.source) == (True, "prior"), "the image's own edges know no level"
    assert found["a"].placed(params, (60, 80)).edges == params.edges
    others = (
        replace(found["a"], boxes=()),
        replace(found["a"], background=()),
        replace(found["a"], found=True),
        replace(found["a"], alike=True),
    )
    assert len({start.text() for start in (found["a"], *others)}) == 5


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("a,seed,1,2,,,,", r":2: kind: 'seed' is none of start, not, box"),
        ("a,start,1,2,,,9,", r":2: bottom: a row of the kind start has none"),
        ("a,box,1,2,,3,,", r":2: bottom: '' is not a finite number"),
        ("a,probability,,,,,,.3\na,probability,,,,,,.4", r":3: 'a' has a row for this probability already"),
        ("a,probability,,,,,,1.3", r":2: value: a probability is from 0.01 to 0.99, not 1.3"),
        ("a,clearance,,,,,,-2", r":2: value: a clearance is from 0 to 1000, not -2"),
        ("a,not,1,2,,,,\na,not,1,2,,,,", r":3: 'a' has a row for this not already"),
        ("a,not,1,2,,,,1", r":2: value: the number of starts before this row .* needs a radius"),
        ("a,not,1,2,3,,,-1", r":2: value: the number of starts before this row is 0 or more"),
    ],
)
def test_rows_of_other_kinds_are_refused_by_line(row: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=said):
        load_starts(write(tmp_path, f"image,kind,x,y,radius,right,bottom,value\n{row}\n"), ["a"])


def test_a_model_finds_the_starts_of_images_without_a_row(tmp_path: Path) -> None:
    path = write(tmp_path, "image,x,y\na,1,2\n")
    assert load_starts(path, ["a", "b"], partial=True) == {"a": Start(1, 2)}
    assert finds_starts(load_params(None, {"edges.model": "own.ffmodel"}))
    assert not (finds_starts(load_params(None, {"edges.model": "net.onnx"})))
    assert not (finds_starts(load_params()))


def test_a_name_that_looks_like_a_formula_is_found_as_tables_write_it(tmp_path: Path) -> None:
    names = {"=a.png": Start(1, 2), "-b,c.png": Start(3, 4), "\udcff.png": Start(5, 6), " d.png": Start(7, 8)}
    assert load_starts(write(tmp_path, starts_table(names)), names) == names


def test_of_equal_starts_one_counts() -> None:
    image = np.full((120, 160), 60, np.uint8)
    cv2.circle(image, (80, 60), 40, 200, -1)
    once, twice = (ffseg.segment(image, {"init.circles": [[80, 60, 6]] * times}) for times in (1, 2))
    assert np.array_equal(once.mask, twice.mask)


def twigs(seed: int) -> np.ndarray:
    """Lines of all greys on the left of a plain picture."""
    rng, image = np.random.default_rng(seed), np.full((90, 120), 130, np.uint8)
    for _ in range(int(rng.integers(4, 14))):
        ends = rng.integers(0, [70, 90], (2, 2)).tolist()
        cv2.line(image, *ends, int(rng.integers(40, 110)), int(rng.integers(1, 3)))
    return image


def spot() -> np.ndarray:
    image = np.full((112, 78), 150, np.uint8)
    image[28:37, 19:26] = 80
    return image


@pytest.mark.parametrize(
    ("image", "source", "circles"),
    [
        (spot(), "auto", [[26, 29, 2], [31, 42, 20], [57, 93, 12]]),
        (twigs(13), "gradient", [[56, 36, 10], [67, 33, 4], [55, 36, 10]]),
        (twigs(19), "gradient", [[54, 37, 11], [48, 35, 9], [55, 48, 10], [50, 39, 8]]),
        (twigs(41), "gradient", [[44, 30, 11], [50, 30, 10], [41, 26, 10], [48, 20, 9]]),
    ],
)
def test_starts_that_overlap_make_one_contour(image: np.ndarray, source: str, circles: list[list[float]]) -> None:
    """Two contours covered one region, each across the other, and where edges held them, until the work was spent."""
    found = ffseg.segment(image, {"init.circles": circles, "edges.source": source})
    assert found.stats.stop_reason == "converged"
    assert abs(sum(one.signed_area for one in found.contours) / np.count_nonzero(found.mask) - 1) < 0.01


def test_starts_that_overlap_close_in_on_all_that_they_hold() -> None:
    image, truth = np.full((100, 140), 130, np.uint8), np.zeros((100, 140), np.uint8)
    for x, y, radius in ((87, 64, 7), (91, 45, 10)):
        cv2.circle(image, (x, y), radius, 70, -1)
        cv2.circle(truth, (x, y), radius, 1, -1)
    circles, closing = [[90, 65, 15], [90, 44, 23]], {"edges.source": "gradient", "contour.balloon": -2}
    found = ffseg.segment(image, {"init.circles": circles, **closing}).mask
    assert iou(found, truth * np.uint8(255)) > 0.9  # the corners between them stay filled


def test_starts_that_overlap_between_pixels_are_starts() -> None:
    image = np.full((60, 80), 60, np.uint8)
    cv2.circle(image, (40, 30), 20, 200, -1)
    circles = [[40.5, 30.5, 0.4], [40.7, 30.5, 0.4]]  # neither holds the middle of a pixel
    assert ffseg.segment(image, {"init.circles": circles}).mask[30, 40]


def test_a_start_that_the_region_has_lost_is_told() -> None:
    image = np.full((160, 150), 150, np.uint8)
    cv2.rectangle(image, (12, 12), (138, 150), 60, 2)
    cv2.line(image, (50, 12), (50, 150), 60, 2)
    found = ffseg.segment(image, {"init.circles": [[30, 100, 4], [138, 80, 0.5]]})
    assert not found.mask[80, 138]
    assert found.messages == ("the start at (138, 80), radius 0.5 is not in the region",)


def test_what_a_start_mask_has_outside_the_domain_is_left_out() -> None:
    """It stood in the region, with the score of what was found in the domain."""
    image, domain, start = (np.full((120, 200), level, np.uint8) for level in (150, 0, 0))
    image[10:110, 10:90], domain[:, :100] = 90, 255
    start[50:70, 40:60] = start[50:70, 150:170] = 255
    found = ffseg.segment(image, start_mask=start, domain=domain)
    alone = ffseg.segment(image, start_mask=np.where(domain > 0, start, 0).astype(np.uint8), domain=domain)
    assert (found.messages, alone.messages) == (("what the start mask has outside the domain was left out",), ())
    np.testing.assert_array_equal(found.mask, alone.mask)
    assert not found.mask[domain == 0].any()


def test_a_start_mask_of_a_line_is_a_start() -> None:
    mask = np.zeros((40, 40), np.uint8)
    mask[5:30, 12] = 1
    assert abs(sum(ring_area(one) for one in outlines(mask)) - 25) < 13  # half a pixel round the centres
    mask[10:20, 25:35], mask[35, 3] = 1, 1  # beside thicker parts, too
    assert len(outlines(mask)) == 3


def test_an_image_with_a_box_only_has_no_start_in_its_row(tmp_path: Path) -> None:
    two_discs(tmp_path / "in", "a.png")
    given = "image,kind,x,y,radius,right,bottom,value\na,box,5,15,,55,65,\n"
    run_from(tmp_path / "in", given, tmp_path / "out", load_params())
    (row,) = table(tmp_path / "out" / "timings.csv")
    assert (row["start_x"], row["start_radius"]) == ("", "")


def test_a_start_that_is_moved_into_the_region_leaves_nothing_outside_it() -> None:
    """The ground that it had covered got a start of its own: 76,000 px for 9,500."""
    y, x = np.mgrid[:240, :320]
    map_of = (1 / (1 + np.exp((np.hypot(x - 160, y - 120) - 55) / 12))).astype(np.float32)
    moved = {"init.center": [202, 120], "init.radius": 16}
    found = ffseg.segment(np.full((240, 320), 128, np.uint8), moved, evidence=map_of)
    assert "was moved to" in found.messages[0]
    assert found.mask.sum() == pytest.approx(np.pi * 55**2, rel=0.02)


@pytest.mark.parametrize("source", ["auto", "prior"])
@pytest.mark.parametrize("how", [{"init.boxes": [[30, 20, 211, 161]]}, {"init.radius": 80}, {"init.mask": "mask.png"}])
def test_what_closes_in_asks_the_depth_of_its_start(source: str, how: dict[str, object], tmp_path: Path) -> None:
    """The ground round the object counted as inside: nothing was left. It fills three fifths of each start, as is assumed."""
    y, x = np.mgrid[:180, :240]
    truth, noise = (
        ((x - 120) / 70) ** 2 + ((y - 90) / 50) ** 2 < 1,
        np.random.default_rng(0).normal(0, 14, (180, 240, 3)),
    )
    image = np.clip(np.where(truth[..., None], (80, 150, 120), (120, 115, 140)) + noise, 0, 255).astype(np.uint8)
    write_image(tmp_path / "mask.png", (np.abs(x - 120) < 90) & (np.abs(y - 90) < 70))
    own = {key: str(tmp_path / value) if key == "init.mask" else value for key, value in how.items()}
    params: dict[str, object] = {"contour.balloon": -4, "edges.source": source, **own}
    assert overlap(ffseg.segment(image, params).mask, truth) > 0.97
    with pytest.raises(ffseg.SegmentationError, match="a start mask and init.circles do not go together"):
        ffseg.segment(image, {"init.circles": [[9, 9, 3]]}, start_mask=truth)


@pytest.mark.parametrize(("radius", "own"), [("auto", 4.0), (7.0, 7.0)])
def test_a_circle_without_a_radius_is_a_click(radius: float | str, own: float) -> None:
    params = load_params(None, {"init.circles": [[30, 40, 6], [90, 40]], "init.radius": radius})
    assert params.init.circles_in((80, 400)) == ((30, 40, 6), (90, 40, own))
    assert len({len(one) for one in smaller(params, 2).init.circles}) == 2
