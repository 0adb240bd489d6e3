"""Parameters: loading, overriding, errors that come all at once; files as they are written, read and in the JSON Schema."""

import json
import pickle
import string
from dataclasses import FrozenInstanceError, fields
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ffseg.errors import ParameterError
from ffseg.image.edges import GRADIENT_SCALE
from ffseg.methods.freeform import native_options
from ffseg.native import _core
from ffseg.parameter_files import load_params, presets
from ffseg.parameter_text import json_schema, to_yaml
from ffseg.parameters import Contour, Edges, Init, Parameters, Region
from ffseg.schema.kinds import FilePath, Flag, Integer, Kind, Many, Name, Number, OrWord, Row, Text
from ffseg.schema.nodes import Origin, Problems
from ffseg.schema.sections import Leaf, collect, flat, leaves
from ffseg.schema.strict_yaml import parse


def file_with(text: str, folder: Path) -> Path:
    path = folder / "p.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def lines_of(call: object, *arguments: object) -> list[str]:
    with pytest.raises(ParameterError) as caught:
        call(*arguments)  # type: ignore[operator]
    return str(caught.value).splitlines()


def test_no_source_gives_the_defaults() -> None:
    assert load_params() == load_params(None, {}) == load_params(None, []) == Parameters()


def test_defaults_are_checked_once() -> None:
    """They cannot be changed, so that every image may have the same set."""
    assert load_params() is load_params()


def test_every_preset_loads_and_default_is_the_default() -> None:
    assert {"default", "toy-fixed", "toy-refined", "toy-full", "omni-indoor", "omni-outdoor"} <= set(presets())
    loaded = {name: load_params(name) for name in presets()}
    assert loaded.pop("default") == Parameters()
    assert all(params != Parameters() for params in loaded.values())


def test_toy_presets_are_those_of_the_papers_figure() -> None:
    expected = {"fixed": (80, False, False), "refined": (8, True, False), "full": (8, True, True)}
    chosen = {name: load_params(f"toy-{name}").contour for name in expected}
    assert {name: (one.patches, one.refine, one.topology) for name, one in chosen.items()} == expected


def test_overrides_win_over_the_file_and_the_last_one_wins(tmp_path: Path) -> None:
    path = file_with("contour: {degree: 2, balloon: 1e-3}\nedges.canny: [10, 30]\n", tmp_path)
    params = load_params(path, ["contour.degree=4", "init.center=[400,300]", "contour.degree=5"])
    assert (params.contour, params.edges) == (Contour(degree=5, balloon=0.001), Edges(canny=(10.0, 30.0)))
    assert params.init == Init(center=(400.0, 300.0))


def test_python_overrides_take_python_values() -> None:
    overrides = {"contour": {"degree": np.int64(2)}, "init.center": np.array([1, 2]), "init.mask": Path("m.png")}
    params = load_params(None, overrides)
    assert params.contour.degree == 2
    assert type(params.contour.degree) is int
    assert params.init == Init(center=(1.0, 2.0), mask="m.png")


def test_two_equal_levels_are_thresholds_but_no_range() -> None:
    assert load_params(None, {"edges.canny": [10, 10]}).edges.canny == (10, 10)
    assert "ascending and apart" in lines_of(load_params, None, {"input.range": [10, 10]})[0]


def test_all_errors_at_once_each_with_its_place(tmp_path: Path) -> None:
    text = "contour:\n  degree: 9\n  split_treshold: 3\nedges:\n  canny: [30,\n    10]\nzebra: 1\ndegree: 2\n"
    path = file_with(text, tmp_path)
    assert load_params(None, ['region.label="part #2"']).region.label == "part #2"
    assert lines_of(load_params, path, ["contour.refine=yes", "balloon", "region.label=part #2"]) == [
        f"{path}:2: contour.degree: 9 is not an integer from 1 to 6",
        f"{path}:3: contour.split_treshold: unknown key; did you mean 'contour.split_threshold'?",
        f"{path}:5: edges.canny: [30, 10] is not [low, high], each a number from 0 to 10000, ascending",
        f"{path}:7: zebra: unknown key; 'ffseg config show' lists every key",
        f"{path}:8: degree: unknown key; did you mean 'contour.degree'?",
        "--set balloon: write KEY=VALUE, such as contour.degree=2",
        "--set region.label=part #2: what follows ' #' is a comment and would be lost; quote it: region.label=\"part #2\"",
        "--set contour.refine=yes: contour.refine: 'yes' is not true or false; write true",
    ]


def test_an_error_is_reported_even_where_an_override_replaces_the_value(tmp_path: Path) -> None:
    assert len(lines_of(load_params, file_with("contour.degree: 9\n", tmp_path), {"contour.degree": 3})) == 1


def test_more_errors_than_a_screen_holds_are_counted(tmp_path: Path) -> None:
    lines = lines_of(load_params, file_with("".join(f"k{i}: 1\n" for i in range(30)), tmp_path))
    assert (len(lines), lines[-1]) == (21, "... and 10 more problems")


@pytest.mark.parametrize(
    ("key", "bad"),
    [
        ("contour.degree", (0, 7, True, 2.0, "3", None)),
        ("contour.balloon", (-16.1, 16.1, float("nan"), "2", False)),
        ("edges.sigma", (0, -1, 20.5, float("inf"))),
        ("edges.canny", ("automatic", [1], [1, 2, 3], [2, 1], [-1, 2], 3)),
        ("init.center", ("middle", [1, "x"], [float("inf"), 0], {"x": 1})),
        ("init.radius", (0, -1, 10**400, float("inf"), None)),
        ("init.circles", ([1, 2, 3], [[1]], [[1, 2, 0]], [[1, 2, 3]] * 1001)),
        ("domain.mask", ("", 3, "a\0b")),
        ("method", ("", 1, None)),
    ],
)
def test_values_out_of_range_are_refused_in_python_too(key: str, bad: tuple[object, ...]) -> None:
    for value in bad:
        assert lines_of(load_params, None, {key: value})[0].startswith(f"overrides: {key}")


def test_sections_check_themselves() -> None:
    assert lines_of(lambda: Contour(degree=9, refine="no")) == [  # type: ignore[arg-type]
        "parameters: degree: 9 is not an integer from 1 to 6",
        "parameters: refine: 'no' is not true or false; write false",
    ]


def test_file_names_are_relative_to_the_file_they_stand_in(tmp_path: Path) -> None:
    path = file_with("domain: {mask: sub/../m.png}\ninit.mask: /abs/i.png\n", tmp_path)
    params = load_params(path)
    assert (params.domain.mask, params.init.mask) == (str(tmp_path / "m.png"), "/abs/i.png")
    assert load_params(path, ["domain.mask=m.png"]).domain.mask == "m.png"


def test_unknown_preset_names_the_nearest_and_the_others() -> None:
    (line,) = lines_of(load_params, "toy-ful")
    assert "did you mean 'toy-full'?" in line
    assert "omni-indoor" in line


def test_overrides_as_one_text_are_refused() -> None:
    assert "list" in lines_of(load_params, None, "contour.degree=2")[0]


def test_parameters_are_values() -> None:
    params = load_params("toy-full")
    assert (pickle.loads(pickle.dumps(params)), hash(params)) == (params, hash(load_params("toy-full")))
    for part, key in ((params, "method"), (params.contour, "degree")):
        with pytest.raises(FrozenInstanceError):
            setattr(part, key, getattr(part, key))


def test_every_key_has_a_description_and_a_default_that_is_allowed() -> None:
    known = leaves(Parameters)
    assert all(leaf.doc for leaf in known.values())
    assert load_params(None, {key: leaf.default for key, leaf in known.items()}) == Parameters()


def test_section_fields_are_all_declared() -> None:
    assert [field.name for field in fields(Parameters) if not field.metadata] == []


@pytest.mark.parametrize("name", ["EvolutionOptions", "SnakeOptions", "LevelSetOptions", "PaperOptions"])
def test_the_core_has_no_defaults_of_its_own(name: str) -> None:
    """Whoever forgets to hand a parameter on sees it at once, instead of a value that once was the default."""
    options = getattr(_core, name)()
    values = {key: getattr(options, key) for key in dir(options) if not key.startswith("_")}
    assert len(values) >= 4
    assert not any(values.values())


def test_every_option_of_the_evolution_comes_from_the_parameters() -> None:
    contour = Contour(2, 8, 31.0, -3.0, max_iterations=7, clearance=9.0, settle=2.5)
    options = native_options(Parameters(contour=contour, region=Region(weight=0.5, window=64)), 20.0)
    found = {key: getattr(options, key) for key in dir(options) if not key.startswith("_")}
    assert found == {
        "degree": 2, "split_threshold": 31.0, "balloon": 3.0, "refine": True, "topology": True, "max_iterations": 7, "budget": 0,
        "clearance": 9.0, "settle": 2.5, "ridge_low": 10 * GRADIENT_SCALE,
        "weight": 0.5, "window": 64.0,
    }  # fmt: skip


LEAVES = leaves(Parameters)
WORDS = st.text(string.ascii_letters + string.digits + " ./-_:#'\"é\N{HORSE}\n", min_size=1, max_size=12)
SCHEMA = jsonschema.Draft7Validator(json_schema())


def allowed(kind: Kind) -> st.SearchStrategy[object]:  # noqa: PLR0911 - one for each kind
    """Values of a kind, its limits among them."""
    match kind:
        case Flag():
            return st.booleans()
        case Integer(low, high):
            return st.integers(low, high)
        case Number(low, high, above):
            return st.floats(max(low, -1e6), min(high, 1e6), exclude_min=above)
        case Name(choices):
            return st.sampled_from(choices) | st.just("own.module:function")
        case Text(choices):
            return st.sampled_from(choices) if choices else WORDS
        case FilePath():
            return st.none() | WORDS
        case Row(_, parts, order):
            rows = st.tuples(*map(allowed, parts))
            rows = rows.filter(lambda row: "apart" not in order or len(set(row)) == len(row))
            return rows.map(lambda row: tuple(sorted(row))) if order else rows
        case Many(part, _):
            return st.lists(allowed(part), max_size=3).map(tuple)
        case OrWord(word, other):
            return st.just(word) | allowed(other)
    raise AssertionError(f"no strategy for {kind}")


def setting(leaf: Leaf) -> st.SearchStrategy[tuple[str, object]]:
    return st.tuples(st.just(leaf.key), allowed(leaf.kind))


SETTINGS = st.lists(st.sampled_from(list(LEAVES.values())).flatmap(setting), max_size=12).map(dict)
PLAIN = st.none() | st.booleans() | st.integers(-(10**20), 10**20) | st.floats(allow_nan=False, allow_infinity=False)
JSON = st.recursive(
    PLAIN | st.text(st.characters(exclude_categories=["Cc", "Cs", "Cn", "Co"]), max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(string.ascii_letters, max_size=6), inner),
    max_leaves=12,
)


@pytest.mark.parametrize("text", ["", "edges:\n", "edges: {}\n"])
def test_editors_take_what_is_empty_as_the_reader_does(text: str) -> None:
    problems = Problems()
    node = parse(text, Origin("f"), problems)
    assert collect(Parameters, node, problems) == {}
    assert problems.lines == []
    assert SCHEMA.is_valid(node.plain())


@given(SETTINGS)
def test_written_parameters_are_read_back(settings: dict[str, object]) -> None:
    params = load_params(None, settings)
    problems = Problems()
    values = collect(Parameters, parse(to_yaml(params), Origin("f"), problems), problems)
    assert (problems.lines, values) == ([], flat(params))


@given(JSON)
def test_json_is_read_as_json(value: object) -> None:
    problems = Problems()
    node = parse(json.dumps(value, ensure_ascii=False), Origin("f"), problems)
    assert (problems.lines, node.plain()) == ([], value)


@given(st.text(max_size=60) | st.text("[]{}:,-?&*!|>'\"%@` \n\t#a1", max_size=60))
def test_any_text_is_parsed_or_refused(text: str) -> None:
    problems = Problems()
    node = parse(text, Origin("f"), problems)
    assert node.value is None or problems.lines == [] or "given twice" in problems.lines[0]


@given(st.sampled_from(list(LEAVES.values())), JSON | st.floats(-30, 30) | st.integers(-3, 40), st.booleans())
def test_editors_and_reader_agree(leaf: Leaf, value: object, dotted: bool) -> None:
    section, _, name = leaf.key.rpartition(".")
    document = {section: {name: value}} if section and not dotted else {leaf.key: value}
    try:
        load_params(None, document)
        accepted = True
    except ParameterError:
        accepted = False
    # JSON Schema cannot say "ascending" or "apart", and takes 2.0 for an integer
    descending = leaf.key in ("edges.canny", "input.range") and isinstance(value, list) and len(value) == 2
    whole = isinstance(leaf.kind, Integer) and isinstance(value, float)
    assert accepted == SCHEMA.is_valid(document) or (not accepted and (descending or whole))
