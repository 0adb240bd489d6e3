"""Which scenes fail without a rule of the default path: ``python -m tests.campaigns.without [--only WORD]``.

Turns off one rule after another, each by values of its constants with which it does nothing, and runs the tests that hold its
scenes. The rows it prints are the table of docs/pipeline.md; a rule with which nothing fails has no scene, and goes.
"""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from importlib import import_module
from io import StringIO
from math import inf
from pathlib import Path
from types import ModuleType

import pytest

from ffseg.image.edges import PRIOR_CALIBRATION, ScoreCalibration
from tests.campaigns import harness

UNIT = Path(__file__).resolve().parents[1] / "unit"


@dataclass(frozen=True)
class Rule:
    """What is turned off, by which values of which file's constants, and the test files with its scenes."""

    name: str
    place: str
    values: Mapping[str, object]
    scenes: tuple[str, ...]


_DISC, _PRIOR, _SIDES, _ISLANDS, _JUDGE = ("bounds",), ("prior",), ("start_sides",), ("islands",), ("judge",)

RULES = (
    Rule("thresholds from the local noise", "image/edges.py", {"AUTO_SPREAD": 1.0}, ("edges", "prior")),
    Rule("an enlargement is taken back", "image/magnified.py", {"FACTORS": ()}, ("magnified",)),
    Rule("only whole pictures of few pixels", "image/magnified.py", {"MAX_DIFFERENT": 1.0}, ("magnified",)),
    Rule("nor where tiles of it are none", "image/magnified.py", {"MAX_DIFFERENT_IN_TILES": inf}, ("magnified",)),
    Rule("a picture was not tiny before", "image/magnified.py", {"MIN_SIDE": 0}, ("magnified",)),
    Rule("edges decide only if clear", "image/boundary.py", {"MIN_STRENGTH": 0.0}, _PRIOR),
    Rule("a tenth may be fainter", "image/boundary.py", {"FAINT_FRACTION": 0.0}, _PRIOR),
    Rule("edges decide only round what is plain", "image/boundary.py", {"MAX_LIVELY": 1.0}, _PRIOR),
    Rule("noise is plain", "image/boundary.py", {"NOISE_GRADIENT": 0.0}, _PRIOR),
    Rule("edges of the boundary are no texture", "image/boundary.py", {"EDGE_GAIN": 0.0}, _PRIOR),
    Rule("no edge at the border", "image/boundary.py", {"BORDER_MARGIN": 0}, (*_PRIOR, *_JUDGE, "edges")),
    Rule("what has met no edge does not count", "evidence/auto.py", {"MET_STRENGTH": 0.0}, _PRIOR),
    Rule("what looks nearly alike is left out", "evidence/prior.py", {"CAUTION": 0.0}, _PRIOR),
    Rule("the first click outside counts elsewhere, too", "evidence/hints.py", {"ELSEWHERE_WEIGHT": 0.0}, ("hints",)),
    Rule("a correction takes little elsewhere", "evidence/clicks.py", {"MOST_TAKEN": 1.0}, ("hints",)),
    Rule("a click counts near where it lies", "evidence/clicks.py", {"CLICK_REACH": inf}, ("hints",)),
    Rule("more than twenty starts are samples", "evidence/clicks.py", {"MOST_CORRECTIONS": 10**6}, ("hints",)),
    Rule("a start lies on one side", "starts/sides.py", {"MIN_KEPT_RADIUS": inf}, _SIDES),
    Rule("a start that edges part may be a click", "starts/sides.py", {"MIN_PARTED": 10**6}, _SIDES),
    Rule("what is pointed at is seen closer", "evidence/closer.py", {"WORKING_SIZE": 10**6}, ("closer",)),
    Rule("spare room round a start", "starts/moved.py", {"SPARE_MARGIN": 0.0}, (*_SIDES, *_DISC)),
    Rule("a start keeps its size", "starts/moved.py", {"SIZE_WEIGHT": 0.0}, (*_SIDES, *_DISC)),
    Rule("the disc of a mirror", "image/disc.py", {"MIN_CIRCLE_FRACTION": inf}, _DISC),
    *(
        Rule(f"the disc: {name}", "image/disc.py", {name: value}, _DISC)
        for name, value in {
            "CUT_LEVELS": (0.3,), "MIN_CIRCLE_FRACTION": 0.0, "MAX_BRIGHT_OUTSIDE": 1.0, "MIN_LEVEL_DEVIATION": 0.0,
        }.items()
    ),
    Rule("parts beyond narrow places", "starts/pockets.py", {"MIN_PIXELS": inf}, _ISLANDS),
    Rule("what is narrow", "starts/pockets.py", {"NARROW_WIDTH": 1.0}, _ISLANDS),
    Rule("islands", "starts/islands.py", {"MIN_LOG_ODDS": inf}, _ISLANDS),
    Rule("islands as sure as the start's", "starts/islands.py", {"SURE_RATIO": 0.0}, _ISLANDS),
    Rule("islands that are sure", "starts/islands.py", {"MIN_LOG_ODDS": -inf}, _ISLANDS),
    Rule("islands worth a start", "starts/islands.py", {"MIN_AREA_FRACTION": 0.0}, _ISLANDS),
    Rule("the region fills its domain", "judge.py", {"FILLED_FRACTION": inf}, _JUDGE),
    Rule("the outline is the border", "judge.py", {"BORDER_FRACTION": inf}, _JUDGE),
    Rule("early and across bound the score", "judge.py", {"MAX_DOUBTED_SCORE": 1.0}, _JUDGE),
    Rule("the score is calibrated", "image/edges.py", {"PRIOR_CALIBRATION": ScoreCalibration(1.0, 1.0)}, _JUDGE),
    Rule("in boxes, too", "evidence/box.py", {"CALIBRATION": PRIOR_CALIBRATION}, _JUDGE),
    Rule("clicks take doubts away", "image/edges.py", {"CLICK_WEIGHT": 0.0}, _JUDGE),
)  # fmt: skip
"""Each rule of the default path, and how it is turned off."""


@contextmanager
def changed(place: str, values: Mapping[str, object]) -> Iterator[None]:
    """The constants of a file with other values, wherever they have been imported."""
    home = "ffseg." + place.removesuffix(".py").replace("/", ".")
    import_module(home)
    before = [
        (module, name, vars(module)[name])
        for key, module in list(sys.modules.items())
        for name in values
        if key.startswith("ffseg") and name in vars(module) and (key == home or _imports(module, home, name))
    ]
    for module, name, _ in before:
        setattr(module, name, values[name])
    try:
        yield
    finally:
        for module, name, value in before:
            setattr(module, name, value)


def _imports(module: ModuleType, home: str, name: str) -> bool:
    """Whether a module has the constant from its home and none of its own."""
    file = module.__file__ or ""
    text = Path(file).read_text("utf-8") if file.endswith(".py") else ""
    return f"from {home} import" in text and f"\n{name} = " not in text


class _Failed:
    def __init__(self) -> None:
        self.names: list[str] = []
        self.ran = 0

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.ran += report.when == "call"
        if report.failed:
            self.names.append(report.nodeid.rpartition("::")[2])


def failing(rule: Rule) -> tuple[list[str], int]:
    """Names of the tests that fail without a rule, and how many have run."""
    seen = _Failed()
    files = [str(UNIT / f"test_{name}.py") for name in rule.scenes]
    with changed(rule.place, rule.values), redirect_stdout(StringIO()):
        pytest.main(["-q", "-p", "no:cacheprovider", *files], plugins=[seen])
    return seen.names, seen.ran


def main(only: str = "") -> int:
    """Print a row for each rule, or those of a part of their names; 1 if one has no scene."""
    idle = 0
    for rule in RULES:
        if only in rule.name:
            names, ran = failing(rule)
            idle += not names
            values = ", ".join(f"`{name}` {value}" for name, value in rule.values.items())
            scene = names[0].partition("[")[0].removeprefix("test_").replace("_", " ") if names else "NONE"
            print(f"| {rule.name} | {values} | {len(names)} of {ran} | {scene} |", flush=True)
    return int(idle > 0)


if __name__ == "__main__":
    harness.as_command(main)
