"""Parts of a region that lie apart from the one round the start."""

import numpy as np
import pytest

from ffseg.api import segment
from ffseg.evidence import auto
from ffseg.evidence import prior as evidence
from ffseg.starts.islands import islands
from ffseg.starts.pockets import starts_beyond

SHAPE = (120, 200)


def apart(other: float, width: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """A region of log odds 4 round a start on the left, another of those odds on the right."""
    odds = np.full(SHAPE, -3, np.float32)
    odds[20:100, 20:90] = 4
    odds[30:90, 120 : 120 + width] = other
    rows, columns = np.indices(SHAPE)
    start = (columns - 50) ** 2 + (rows - 60) ** 2 <= 10**2
    odds[start] = evidence.MAX_LOG_ODDS
    return odds, start


def test_a_part_as_sure_as_the_starts_gets_a_start_in_its_middle() -> None:
    odds, start = apart(3)
    ((x, y, radius),) = islands(odds, start, 12)
    assert 140 <= x <= 160
    assert 55 <= y <= 65
    assert radius == 12


@pytest.mark.parametrize(("other", "width"), [(1.5, 60), (-1, 60), (4, 8)])
def test_a_doubtful_or_small_part_gets_none(other: float, width: int) -> None:
    assert islands(*apart(other, width), 12) == ()


def test_nothing_is_sure_enough_where_the_start_is_not() -> None:
    odds, start = apart(0.9)
    odds[odds == 4] = 0.9
    assert islands(odds, start, 12) == ()


def test_what_hangs_together_with_the_start_is_no_island() -> None:
    odds, start = apart(4)
    odds[58:62, 80:130] = 4
    assert islands(odds, start, 12) == ()


@pytest.fixture
def prior_decides(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evidence.PriorView, "of_pixels", lambda *_: apart(3)[0])
    monkeypatch.setattr(auto, "_trial", lambda *_: None)


@pytest.mark.usefixtures("prior_decides")
def test_the_contour_takes_islands_where_the_prior_decides() -> None:
    even = np.full((*SHAPE, 3), 120, np.uint8)
    given = {"init.center": [50, 60], "init.radius": 10}
    both, alone = (segment(even, {**given, "region.islands": islands}) for islands in (True, False))
    assert both.source == alone.source == "prior"
    assert (len(both.contours), len(alone.contours)) == (2, 1)
    assert np.count_nonzero(both.mask & ~alone.mask) == pytest.approx(60 * 60, rel=0.05)  # corners are rounded
    assert not both.mask[60, 105]


@pytest.mark.usefixtures("prior_decides")
def test_a_part_outside_the_domain_gets_none() -> None:
    domain = np.full(SHAPE, 255, np.uint8)
    domain[:, 110:] = 0
    start = {"init.center": [50, 60], "init.radius": 10}
    assert len(segment(np.full((*SHAPE, 3), 120, np.uint8), start, domain=domain).contours) == 1


def test_parts_behind_narrow_places_get_a_start() -> None:
    free, starts = np.ones((60, 100), bool), np.zeros((60, 100), bool)
    free[:, 48:52], starts[28:33, 20:25] = False, True
    assert starts_beyond(free, starts, 10.0) == ()
    free[29:32, 48:52] = True  # three pixels wide
    ((x, y, radius),) = starts_beyond(free, starts, 10.0)
    assert 60 < x < 90
    assert 20 < y < 40
    assert radius == 10.0
