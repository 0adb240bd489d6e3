"""The parameter set as text: YAML with comments, JSON Schema, and the reference page."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Mapping

from ffseg.parameters import Parameters
from ffseg.schema.kinds import FilePath, JsonSchema
from ffseg.schema.sections import Leaf, Section, flat, leaves, subsections
from ffseg.schema.strict_yaml import scalar

_PLAIN = re.compile(r"[A-Za-z_./][A-Za-z0-9_./ -]*")


def to_yaml(params: Section) -> str:
    """Write every key of a parameter set as YAML, each with what it means and what is allowed."""
    values, sections = flat(params), subsections(type(params))
    lines: list[str] = []
    group = ""
    for key, leaf in leaves(type(params)).items():
        section, _, name = key.rpartition(".")
        if section != group:
            lines += ["", f"# {_first_line(sections[section])}", f"{section}:"]
            group = section
        indent = "  " if section else ""
        lines += [f"{indent}# {leaf.doc}; {leaf.kind.allowed()}", f"{indent}{name}: {yaml_value(values[key])}"]
    return "\n".join(lines) + "\n"


def schema_file() -> str:
    """Write ``configs/schema.json``, which editors check parameter files against."""
    return json.dumps(json_schema(), indent=2) + "\n"


def yaml_value(value: object) -> str:
    """Write one value so that the strict reader gives it back."""
    if isinstance(value, str) and _PLAIN.fullmatch(value) and isinstance(scalar(value), str) and value == value.strip():
        return value
    return json.dumps(value, ensure_ascii=False)


def non_defaults(params: Parameters) -> dict[str, object]:
    """Where a parameter set differs from the defaults; names of files are absolute, for a file may lie anywhere."""
    defaults, kinds = flat(Parameters()), leaves(Parameters)
    return {
        key: os.path.abspath(value) if isinstance(kinds[key].kind, FilePath) and isinstance(value, str) else value
        for key, value in flat(params).items()
        if value != defaults[key]
    }


def as_settings(params: Parameters) -> list[str]:
    """Texts ``KEY=VALUE`` of what differs from the defaults, as ``--set`` takes them."""
    return [f"{key}={yaml_value(value)}" for key, value in non_defaults(params).items()]


def yaml_lines(values: Mapping[str, object], text: Callable[[object], str] = yaml_value) -> list[str]:
    """Lines of a parameter file that sets these keys, by section; ``{}`` where there is none."""
    sections: dict[str, list[str]] = {"": []}
    for key, value in values.items():
        section, _, name = key.rpartition(".")
        sections.setdefault(section, []).append(f"{'  ' if section else ''}{name}: {text(value)}")
    lines = sections.pop("")
    for section, entries in sections.items():
        lines += [f"{section}:", *entries]
    return lines or ["{}"]


def json_schema() -> JsonSchema:
    """JSON Schema (draft 7) of a parameter file."""
    schema = _object_schema(Parameters, leaves(Parameters), "")
    return {"$schema": "http://json-schema.org/draft-07/schema#", "title": "ffseg parameters", **schema}


def to_markdown() -> str:
    """Reference page of all keys: default, what is allowed, meaning."""
    lines = [
        "# Parameters",
        "",
        "Made from `ffseg/parameters.py` by `pytest --update-golden`. Set a key in a YAML file (`--config FILE`), on",
        'the command line (`--set contour.degree=2`) or in Python (`ffseg.load_params(None, {"contour.degree": 2})`).',
    ]
    sections: dict[str, type[Section]] = {"": Parameters, **subsections(Parameters)}
    for name, section in sections.items():
        rows = [leaf for leaf in leaves(Parameters).values() if leaf.key.rpartition(".")[0] == name]
        if rows:
            lines += ["", f"## {name or 'Top level'}", "", _first_line(section), ""]
            lines += ["| key | default | allowed | meaning |", "| --- | --- | --- | --- |", *map(_row, rows)]
    return "\n".join(lines) + "\n"


def _object_schema(section: type[Section], all_leaves: dict[str, Leaf], prefix: str) -> JsonSchema:
    properties: dict[str, object] = {}
    for key, leaf in all_leaves.items():
        name = key[len(prefix) :]
        if key.startswith(prefix) and ("." not in name or not prefix):  # a file may also write all its keys with dots
            properties[name] = {"description": leaf.doc, "default": leaf.default, **leaf.kind.json_schema()}
    for name, inner in subsections(section).items():
        properties[name] = _object_schema(inner, all_leaves, f"{prefix}{name}.")
    return {
        "type": ["object", "null"],  # a section, or a file, may be empty
        "description": _first_line(section),
        "additionalProperties": False,
        "properties": properties,
    }


def _row(leaf: Leaf) -> str:
    cells = (f"`{leaf.key}`", f"`{yaml_value(leaf.default)}`", leaf.kind.allowed(), leaf.doc)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _first_line(section: type[Section]) -> str:
    return (section.__doc__ or "").strip().partition("\n")[0]
