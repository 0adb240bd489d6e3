"""Parameter files: what is written is read back; the JSON Schema and the reader accept the same files."""

import json
import string

import jsonschema
from hypothesis import given
from hypothesis import strategies as st

from ffseg.errors import ParameterError
from ffseg.parameter_text import json_schema, to_yaml
from ffseg.parameters import Parameters, load_params
from ffseg.schema.kinds import FilePath, Flag, Integer, Kind, Many, Name, Number, OrWord, Row, Text
from ffseg.schema.nodes import Problems, Source
from ffseg.schema.sections import Leaf, collect, flat, leaves
from ffseg.schema.strict_yaml import parse

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


@given(SETTINGS)
def test_written_parameters_are_read_back(settings: dict[str, object]) -> None:
    params = load_params(None, settings)
    problems = Problems()
    values = collect(Parameters, parse(to_yaml(params), Source("f"), problems), problems)
    assert problems.lines == []
    assert values == flat(params)


@given(JSON)
def test_json_is_read_as_json(value: object) -> None:
    problems = Problems()
    node = parse(json.dumps(value, ensure_ascii=False), Source("f"), problems)
    assert problems.lines == []
    assert node.plain() == value


@given(st.text(max_size=60) | st.text("[]{}:,-?&*!|>'\"%@` \n\t#a1", max_size=60))
def test_any_text_is_parsed_or_refused(text: str) -> None:
    problems = Problems()
    node = parse(text, Source("f"), problems)
    assert node.value is None or problems.lines == [] or "given twice" in problems.lines[0]


@given(st.sampled_from(list(LEAVES.values())), JSON | st.floats(-30, 30) | st.integers(-3, 40))
def test_editors_and_reader_agree(leaf: Leaf, value: object) -> None:
    section, _, name = leaf.key.rpartition(".")
    document = {section: {name: value}} if section else {name: value}
    try:
        load_params(None, document)
        accepted = True
    except ParameterError:
        accepted = False
    descending = (
        leaf.key in ("edges.canny", "input.range") and isinstance(value, list) and len(value) == 2 and not accepted
    )
    whole = isinstance(leaf.kind, Integer) and isinstance(value, float) and not accepted
    # JSON Schema cannot say "ascending" or "apart", and takes 2.0 for an integer
    assert accepted == SCHEMA.is_valid(document) or descending or whole
