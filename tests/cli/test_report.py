"""``ffseg report`` as a command, and its page in a headless Chromium."""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import chromium
import numpy as np
import pytest
import runs
from commands import Command

from ffseg.batch.report.write import write_report
from ffseg.io.tables import csv_table
from tests.masks import read_mask

HOSTILE = "<img src=x onerror=alert(1)><script>document.title='taken'</script>.png"
MOST_IN_SIGHT = 100
"""Cards: 5 columns and 4 rows of the window of the tests, 3 rows above and below, and one cut at each end."""
BLOCKED = "segmentation: the start contour lies on an edge; move init.center, change init.radius or raise edges.canny"
FAILURES = [(HOSTILE, "truncated: the data ends"), ("blocked.png", BLOCKED)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "aus <b>&amp; #1"
    path.mkdir()
    runs.sample_run(path, failures=FAILURES)
    rows = "complex.png,1,4890,240,190,12,0.41,obstacle\ncomplex.png,2,2400,420,330,7,0.012,false_obstacle\n"
    head = "image,component,area_px,centroid_x,centroid_y,matched_points,max_altitude_m,verdict\n"
    (path / "obstacles.csv").write_text(head + rows)
    write_report(path)
    return path


@pytest.fixture
def tab(browser: chromium.Chromium, folder: Path) -> Iterator[chromium.Chromium]:
    """The page of the run, newly loaded; after each test nothing may have gone wrong in it."""
    browser.open((folder / "report.html").as_uri())
    yield browser
    assert browser.problems == []
    assert [address for address in browser.requests if not address.startswith(("file:", "data:"))] == []


def names(tab: chromium.Chromium) -> list[str]:
    return list(tab.value("[...document.querySelectorAll('#sheet .name')].map((name) => name.textContent)"))


def choose(tab: chromium.Chromium, **values: str) -> None:
    """Fill in the filters, as typing does, and wait for the next frame."""
    for name, value in values.items():
        tab.value(f"document.getElementById({name.replace('__', '-')!r}).value = {value!r}")
    tab.value("document.getElementById('filters').dispatchEvent(new Event('input'))")
    next_frames(tab)


def next_frames(tab: chromium.Chromium) -> None:
    tab.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def open_image(tab: chromium.Chromium, name: str) -> None:
    cards = "[...document.querySelectorAll('#sheet .card')]"
    tab.value(f"{cards}.find((card) => card.textContent.includes({name!r})).click()")
    tab.until("document.getElementById('viewer').open")


def test_the_command_says_where_its_page_is_which_links_the_images(ffseg_command: Command, tmp_path: Path) -> None:
    ffseg_command("run", "samples", "--out", tmp_path, cwd=runs.ROOT, code=0)
    assert ffseg_command("report", tmp_path, code=0).stdout == f"{tmp_path / 'report.html'}\n"
    assert (tmp_path / "report.html").stat().st_size > 50_000
    images = runs.data_of(tmp_path / "report.html")["images"]
    assert (len(images), [(tmp_path / image["pictures"]["image"]).is_file() for image in images]) == (3, [True] * 3)
    assert all(image["contours"] for image in images)


def test_a_pattern_over_folders_names_the_images_of_one_without_folders(ffseg_command: Command, tmp_path: Path) -> None:
    (tmp_path / "moved").mkdir()
    shutil.copy(runs.ROOT / "samples" / "toy.png", tmp_path / "toy.png")
    ffseg_command("run", "toy.png", "--out", "out", cwd=tmp_path, code=0)
    (tmp_path / "toy.png").rename(tmp_path / "moved" / "toy.png")
    done = ffseg_command("report", "out", "--images", "moved/**/*.png", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert runs.data_of(tmp_path / "out" / "report.html")["images"][0]["pictures"]["image"] == "../moved/toy.png"


def test_page_shows_every_image_failures_first(tab: chromium.Chromium) -> None:
    assert names(tab) == [HOSTILE, "blocked.png", "complex.png", "simple.png", "toy.png"]
    assert tab.value("document.getElementById('failures-title').textContent") == "2 of 5 images failed"
    tab.until("[...document.querySelectorAll('#sheet img')].filter((image) => image.naturalWidth > 0).length === 3")


def test_hostile_names_stay_text(tab: chromium.Chromium) -> None:
    assert tab.value("document.querySelectorAll('img[src=x], #sheet script, #failures img').length") == 0
    assert tab.value("document.title") == "aus <b>&amp; #1 - ffseg run"
    assert HOSTILE in tab.value("document.getElementById('failure-list').textContent")
    open_image(tab, "onerror")
    assert tab.value("document.getElementById('viewer-name').textContent") == HOSTILE
    assert tab.value("document.getElementById('viewer-name').children.length") == 0


def test_filters_by_text_status_and_numbers(tab: chromium.Chromium) -> None:
    choose(tab, text="TOY png")
    assert names(tab) == ["toy.png"]
    choose(tab, text="", status="failed")
    assert names(tab) == [HOSTILE, "blocked.png"]
    choose(tab, status="", holes__min="2")
    assert names(tab) == ["complex.png", "toy.png"]
    choose(tab, holes__min="", iou__max="0.9885")
    assert names(tab) == ["toy.png"]
    choose(tab, iou__max="", total_ms__max="12")
    assert (names(tab), tab.value("document.getElementById('count').textContent")) == (["complex.png"], "1 of 5 images")
    assert tab.value("document.querySelectorAll('#plots .dot').length") == 2  # one in each plot


def test_sorts(tab: chromium.Chromium) -> None:
    choose(tab, sort="iou")
    assert names(tab)[2:] == ["toy.png", "simple.png", "complex.png"]
    tab.value("document.getElementById('descending').checked = true")
    choose(tab, sort="total_ms")
    assert names(tab)[2:] == ["toy.png", "simple.png", "complex.png"]
    choose(tab, sort="holes")
    assert names(tab)[2:] == ["complex.png", "toy.png", "simple.png"]


@pytest.fixture
def doubted(tmp_path: Path) -> Path:
    """A page with scores, doubts and notes, and a failure."""
    runs.sample_run(tmp_path, failures=[("cut.png", "truncated: the data ends")])
    table = tmp_path / "timings.csv"
    head, *rows = table.read_text("utf-8").splitlines()
    said = {"simple.png": "0.4,,", "toy.png": "0.9,,a note", "complex.png": "0.99,filled early,"}
    rows = [f"{row},{said.get(row.partition(',')[0], ',,')}" for row in rows]
    table.write_text("\n".join([f"{head},score,doubts,note", *rows, ""]), "utf-8")
    return write_report(tmp_path)


def test_what_needs_a_look_comes_first(browser: chromium.Chromium, doubted: Path) -> None:
    browser.open(doubted.as_uri())
    assert names(browser) == ["cut.png", "complex.png", "toy.png", "simple.png"]
    choose(browser, sort="note")
    assert names(browser) == ["cut.png", "toy.png", "complex.png", "simple.png"]
    choose(browser, sort="score")
    assert names(browser) == ["cut.png", "simple.png", "toy.png", "complex.png"]
    shown = browser.value("[...document.querySelectorAll('.card')].map((c) => c.innerText)")
    texts = dict(zip(names(browser), shown, strict=True))
    assert re.search(r"score 0.99, IoU 0.9900, area \d+ px \(\d+\.\d %\)", texts["complex.png"])
    assert "fills its domain, stopped early" in texts["complex.png"]
    assert "a note" in texts["toy.png"]


def test_doubts_are_filtered_by_kind(browser: chromium.Chromium, doubted: Path) -> None:
    browser.open(doubted.as_uri())
    offered = browser.value("[...document.getElementById('doubt').options].map((one) => one.text)")
    assert offered == ["all", "any (1)", "none (2)", "fills its domain (1)", "stopped early (1)"]
    choose(browser, doubt="early")
    assert names(browser) == ["complex.png"]
    choose(browser, doubt="none")
    assert names(browser) == ["toy.png", "simple.png"]


def test_the_first_screen_and_a_lone_page_show_all(browser: chromium.Chromium, doubted: Path, tmp_path_factory) -> None:
    alone = tmp_path_factory.mktemp("alone") / "report.html"
    alone.write_bytes(doubted.read_bytes())
    browser.open(alone.as_uri())
    browser.until("[...document.querySelectorAll('#sheet img')].filter((image) => image.naturalWidth > 0).length === 3")
    browser.until("document.querySelectorAll('#sheet svg .outer').length >= 3")
    top, size = "getBoundingClientRect().top", "getBoundingClientRect().height"
    assert browser.value(f"document.querySelector('.card').{top}") < 500
    assert browser.value(f"document.getElementById('plots').{top} > document.getElementById('sheet').{top}")
    small = browser.value(f"[...document.querySelectorAll('.card')].map((card) => card.{size})")
    assert small[0] < 0.6 * small[1]
    style = "getComputedStyle(document.querySelector('#sheet .part'))"
    assert browser.value(f"[{style}.strokeWidth, {style}.vectorEffect]") == ["2px", "non-scaling-stroke"]
    fill = "getComputedStyle(document.querySelector('#sheet .fill')).fill"
    assert browser.value(fill) == "none"
    browser.press("f")
    assert browser.value(fill) != "none"


def test_image_opens_with_its_contours_over_it(tab: chromium.Chromium) -> None:
    open_image(tab, "complex.png")
    tab.until("document.querySelectorAll('#layers .part').length === 11")  # outer, 9 holes, one given back
    tab.until("document.querySelector('#layers img').naturalWidth === 800")
    tab.hover(10, 10)
    paths = "[...document.querySelectorAll('#layers path.part')]"
    assert tab.value(f"{paths}.filter((path) => path.classList.contains('obstacle')).length") == 1
    # the vector layer lies on the picture: image pixel (240, 190), corner at 0, is inside the hole drawn there
    inside = "document.querySelector('#layers .obstacle').isPointInFill(new DOMPoint(24050, 19050))"
    assert tab.value(inside) is True
    boxes = "['img', 'svg'].map((tag) => document.querySelector('#layers ' + tag).getBoundingClientRect().toJSON())"
    assert tab.value(f"(() => {{ const [a, b] = {boxes}; return JSON.stringify(a) === JSON.stringify(b) }})()")
    assert "0.410 m, 12 points" in tab.value("document.getElementById('facts').innerText")
    assert "contour.degree" in tab.value("document.getElementById('facts').textContent")


def test_drawn_contour_covers_the_mask(tab: chromium.Chromium, folder: Path) -> None:
    open_image(tab, "complex.png")
    tab.until("document.querySelectorAll('#layers path.part').length === 10")
    mask = read_mask(folder / "masks" / "complex.png")
    points = np.random.default_rng(6).integers((0, 0), (800, 600), (400, 2))
    covered = tab.value(
        "(() => { const paths = [...document.querySelectorAll('#layers path.part')];"
        f"return {points.tolist()}.map(([x, y]) => paths.filter((path) => path.isPointInFill("
        "new DOMPoint(x * 100 + 50, y * 100 + 50))).length % 2 === 1) })()"
    )
    # the packed path is rounded to 1/100 px: a pixel centre that close to the curve may fall on either side
    assert sum(np.array(covered) != mask[points[:, 1], points[:, 0]]) <= 1


def test_hover_highlights_a_component_and_its_line(tab: chromium.Chromium) -> None:
    open_image(tab, "complex.png")
    tab.until("document.querySelectorAll('#layers .obstacle').length === 1")
    box = tab.value("document.querySelector('#layers .obstacle').getBoundingClientRect().toJSON()")
    tab.hover(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    tab.until("document.querySelector('#layers .obstacle').classList.contains('hot')")
    assert "obstacle (0.410 m" in tab.value("document.querySelector('tr.hot').textContent")


def test_keys(tab: chromium.Chromium) -> None:
    tab.press("/")
    assert tab.value("document.activeElement.id") == "text"
    tab.value("document.querySelector('#sheet .card').focus()")
    tab.press("ArrowRight")
    tab.press("ArrowRight")
    assert "complex.png" in tab.value("document.activeElement.textContent")
    tab.press("Enter")
    tab.until("document.getElementById('viewer').open")
    assert tab.value("location.hash") == "#image-1"
    tab.until("document.querySelectorAll('#layers svg').length === 1")
    tab.press("c")
    assert tab.value("document.querySelector('#layers svg').hasAttribute('hidden')") is True
    tab.press("+")
    assert tab.value("document.getElementById('layers').style.transform").endswith("scale(1.5)")
    tab.press("ArrowRight")
    assert tab.value("document.getElementById('viewer-name').textContent") == "simple.png"
    tab.press("b")
    assert tab.value("document.querySelector('#backdrops [aria-pressed=true]').textContent") == "overlay"
    tab.press("Escape")
    tab.until("!document.getElementById('viewer').open")
    tab.until("location.hash === ''")


def test_address_opens_an_image(browser: chromium.Chromium, folder: Path) -> None:
    browser.open((folder / "report.html").as_uri() + "#image-3")
    browser.until("document.getElementById('viewer-name').textContent === 'toy.png'")


def test_contours_are_drawn_where_there_is_no_overlay(browser: chromium.Chromium, tmp_path: Path) -> None:
    runs.sample_run(tmp_path, overlay=False)
    browser.open(write_report(tmp_path).as_uri())
    browser.until("document.querySelectorAll('#sheet .picture svg').length === 3")
    assert browser.problems == []


def test_pictures_that_are_gone_leave_words(browser: chromium.Chromium, tmp_path: Path) -> None:
    runs.large_run(tmp_path, 201)  # too many to stand in the page
    page = write_report(tmp_path, embed_bytes=0).as_uri()
    (tmp_path / "overlays" / "0001.png").unlink()
    (tmp_path / "masks" / "0001.png").unlink()
    browser.open(page)
    browser.until("document.querySelectorAll('#sheet .picture .nothing').length === 1")


def test_comparison_shows_methods_side_by_side(browser: chromium.Chromium, tmp_path: Path) -> None:
    rows = []
    for method, iou in (("freeform", 0.99), ("snake", 0.8)):
        rows.append(["a.png", method, 39, 100, 50, 2.0, 5.0, 8.0, iou, 0.1, 1.0, 2, "ok", ""])
        rows.append(["b.png", method, 39, 100, 50, 2.0, 5.0, 9.0, 1.9 - iou, 0.1, 1.0, 3, "ok", ""])
    rows.append(["a.png", "peer", *[None] * 10, "skipped", "not installed"])
    rows.append(["c.png", "freeform", *[None] * 10, "failed", "truncated: x"])
    (tmp_path / "compare.csv").write_bytes(csv_table(runs.COMPARED, rows))
    browser.open(write_report(tmp_path).as_uri())
    assert browser.value("document.getElementById('failures-title').textContent") == "1 of 3 images failed"
    choose(browser, sort="iou")
    assert names(browser) == ["c.png", "b.png", "a.png"]
    browser.value("document.getElementById('method').value = 'snake'")
    browser.value("document.getElementById('method').dispatchEvent(new Event('change'))")
    choose(browser, sort="iou")
    assert names(browser) == ["c.png", "a.png", "b.png"]
    open_image(browser, "a.png")
    lines = browser.value("[...document.querySelectorAll('#facts tr')].map((line) => line.innerText.split('\\t'))")
    assert ["", "freeform", "snake", "peer"] in lines
    assert ["iou", "0.9900", "0.8000", ""] in lines
    assert "peer: not installed" in browser.value("document.getElementById('facts').innerText")
    assert browser.problems == []


def test_of_2000_images_only_those_in_sight_have_their_picture(browser: chromium.Chromium, tmp_path: Path) -> None:
    runs.large_run(tmp_path, 2000)
    browser.requests.clear()
    browser.open(write_report(tmp_path, (), 0).as_uri())
    browser.until("[...document.querySelectorAll('#sheet img')].some((image) => image.naturalWidth > 0)")
    assert browser.value("document.getElementById('count').textContent") == "2000 of 2000 images"
    assert 0 < len([address for address in browser.requests if "/overlays/" in address]) < MOST_IN_SIGHT
    assert browser.value("document.querySelectorAll('#sheet .card').length") == 2000
    height = browser.value("document.documentElement.scrollHeight")
    for part in (0.3, 0.7, 1.0):
        browser.value(f"scrollTo(0, {part} * document.documentElement.scrollHeight)")
        next_frames(browser)
    browser.until("document.querySelector('#sheet .card:last-child img')?.naturalWidth > 0")
    assert browser.value("document.querySelector('#sheet .card:last-child .name').textContent") == "1999.png"
    assert browser.value("document.querySelectorAll('#sheet img').length") < MOST_IN_SIGHT
    assert browser.value("document.documentElement.scrollHeight") == height
    browser.value("document.querySelector('#sheet .card:last-child').focus()")
    browser.press("ArrowLeft")
    assert "1998.png" in browser.value("document.activeElement.textContent")
    browser.press("Home")
    assert "0000.png" in browser.value("document.activeElement.textContent")
    assert browser.value("document.activeElement.getBoundingClientRect().top") > 0
    choose(browser, text="1999")
    assert names(browser) == ["1999.png"]


def test_find_and_print_reach_every_card(browser: chromium.Chromium, tmp_path: Path) -> None:
    runs.large_run(tmp_path, 300)
    browser.open(write_report(tmp_path).as_uri())
    assert browser.value("find('0299.png')") is True
    assert browser.value("find('no such image')") is False
    browser.value("scrollTo(0, 0); dispatchEvent(new Event('beforeprint'))")
    assert browser.value("document.querySelectorAll('#sheet .picture img').length") == 300
    browser.call("Emulation.setEmulatedMedia", {"media": "print"})
    hidden = "[...document.querySelectorAll('.card')].filter((card) => getComputedStyle(card).contentVisibility !== 'visible')"
    assert browser.value(f"{hidden}.length") == 0
    browser.call("Emulation.setEmulatedMedia", {"media": ""})


def test_page_fits_a_narrow_window(browser: chromium.Chromium, tmp_path: Path) -> None:
    for kind, name in (("run", "timings.csv"), ("compare", "compare.csv")):
        folder = tmp_path / kind
        folder.mkdir()
        long = "a/folder_whose_name_goes_on_and_on/" * 3 + "image.png"
        if kind == "run":
            said = "segmentation: " + "every sample of the start lies on an edge; " * 4
            runs.sample_run(folder, failures=[(long, said)])
        else:
            row = [long, "freeform", 39, 100, 50, 2.0, 5.0, 8.0, 0.9, 0.1, 1.0, 2, "ok", ""]
            (folder / name).write_bytes(csv_table(runs.COMPARED, [row]))
        narrow = {"width": 400, "height": 800, "deviceScaleFactor": 1, "mobile": False}
        browser.call("Emulation.setDeviceMetricsOverride", narrow)
        browser.open(write_report(folder).as_uri())
        assert browser.value("document.getElementById('fold').open") is False
        beyond = "[...document.querySelectorAll('body *')].filter((e) => e.getBoundingClientRect().right > innerWidth)"
        assert browser.value(f"{beyond}.map((e) => e.outerHTML.slice(0, 80))") == []
        assert browser.value("document.documentElement.scrollWidth") <= 400
        browser.value("document.querySelector('#sheet .card').click()")
        browser.until("document.getElementById('viewer').open")
        assert browser.value(f"{beyond}.filter((e) => !e.closest('section, #layers')).map((e) => e.outerHTML)") == []
        keys = "[...document.querySelectorAll('#facts th:first-child')].map((e) => e.getBoundingClientRect().width)"
        assert min(browser.value(keys) or [100]) >= 90  # a word such as boundary_mean_px, of 13 px letters
    browser.call("Emulation.clearDeviceMetricsOverride")
    browser.until("document.getElementById('fold').open")


def test_failed_cards_can_be_read(tab: chromium.Chromium) -> None:
    cut = "[...document.querySelectorAll('.card.failed .numbers')].filter((e) => e.scrollHeight > e.clientHeight + 1)"
    assert tab.value("document.querySelectorAll('.card.failed .numbers').length") > 0
    assert tab.value(f"{cut}.map((e) => e.textContent)") == []
