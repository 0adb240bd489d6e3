"""How a parameter set is read, from files, presets and overrides."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

from ffseg.errors import ParameterError
from ffseg.parameters import Parameters
from ffseg.schema.kinds import Name, names_code
from ffseg.schema.nodes import Node, Origin, Problems, wrap
from ffseg.schema.sections import build, collect, leaves, nearest

Overrides = Mapping[str, object] | Sequence[str]


def load_params(
    source: str | os.PathLike[str] | None = None, overrides: Overrides | None = None, *, allow_code: bool = False
) -> Parameters:
    """Load a parameter set.

    Parameters
    ----------
    source : path, str or None
        A YAML file, the name of a preset, or None for the defaults. File names in a YAML file are relative to it.
    overrides : mapping or sequence of str, optional
        Keys (dotted, or nested mappings) and values, or texts ``KEY=VALUE`` with a YAML value; the last one wins.
        File names in them are relative to the working directory.
    allow_code : bool
        Whether a file may name functions as ``module:function``, which imports code. Overrides are the caller's own words,
        and names of installed plug-ins import what somebody has installed.

    Returns
    -------
    params : Parameters
        Checked and complete: keys not given have their default.

    Raises
    ------
    ParameterError
        One line for everything that is wrong: where, which key, what is allowed, the nearest key.

    Examples
    --------
    >>> params = ffseg.load_params("toy-full", {"init.radius": 60})
    >>> params.init.radius, ffseg.load_params(None, ["contour.degree=2"]).contour.degree
    (60.0, 2)
    """
    if source is None and overrides is None:
        return _defaults()
    problems = Problems()
    from_file = {} if source is None else written(source, problems)
    values: dict[str, object] = {}
    for root in _override_nodes(overrides, problems):
        values.update(collect(Parameters, root, problems))
    if not allow_code:
        _refuse_code({key: value for key, value in from_file.items() if key not in values}, str(source), problems)
    problems.raise_as(ParameterError)
    return build(Parameters, {**from_file, **values})


def written(source: str | os.PathLike[str], problems: Problems) -> dict[str, object]:
    """Values that a parameter file or preset gives, by dotted key."""
    return collect(Parameters, _file(source, problems), problems)


def _refuse_code(values: Mapping[str, object], name: str, problems: Problems) -> None:
    """Note the keys of a file that would import code: the file may be somebody else's."""
    for key, value in values.items():
        if isinstance(leaves(Parameters)[key].kind, Name) and names_code(str(value)):
            problems.add(
                name,
                f"{key}: {value} imports code that the file names; if you trust it, add --allow-code (in Python "
                f"allow_code=True), or name it yourself: --set {key}={value}",
            )


@cache
def _defaults() -> Parameters:
    """The set nobody has changed: it cannot be, so that one is enough."""
    return Parameters()


ParametersLike = Parameters | str | os.PathLike[str] | Mapping[str, object] | None
"""A parameter set, a preset's name, a parameter file, overrides of the defaults, or None for the defaults."""


def parameter_set(params: ParametersLike) -> Parameters:
    """A parameter set from whatever `segment` takes for one."""
    if isinstance(params, Parameters):
        return params
    if isinstance(params, Mapping):
        return load_params(None, params)
    if params is None or isinstance(params, str | os.PathLike):
        return load_params(params)
    raise ParameterError(
        f"params is of type {type(params).__name__}; give a preset's name, a file, a dict such as {{'init.radius': 20}}, "
        "or what ffseg.load_params returns"
    )


def presets() -> dict[str, Path]:
    """Parameter files that come with ffseg, by name.

    Examples
    --------
    >>> sorted(ffseg.presets())[:2]
    ['default', 'omni-indoor']
    """
    here = Path(__file__).parent
    folder = next((path for path in (here / "configs", here.parent / "configs") if path.is_dir()), None)
    files = sorted(folder.glob("*.yaml")) if folder else []
    return {path.stem: path for path in files if path.stem != "peers"}  # that file is for `ffseg compare --peers`


def _file(source: str | os.PathLike[str], problems: Problems) -> Node:
    name = os.fspath(source)
    if isinstance(source, str) and not (name.endswith((".yaml", ".yml", ".json")) or os.sep in name or "/" in name):
        known = presets()
        if name not in known and not os.path.exists(name):
            hint = nearest(name, list(known))
            problems.add(name, f"no such preset or file{hint}; the presets are {', '.join(known)}")
            return Node({}, Origin(name))
        name = os.fspath(known.get(name, name))
    from ffseg.schema import strict_yaml  # loads yaml, 13 ms that a worker need not spend

    return strict_yaml.read(name, problems)


def _override_nodes(overrides: Overrides | None, problems: Problems) -> list[Node]:
    if overrides is None:
        return []
    if isinstance(overrides, Mapping):
        return [wrap(overrides, Origin("overrides"))]
    if not isinstance(overrides, list | tuple) or not all(isinstance(text, str) for text in overrides):
        raise ParameterError("overrides must be a mapping or a list of 'KEY=VALUE' texts; put the text into a list")
    return [_assignment(text, problems) for text in overrides]


def _assignment(text: str, problems: Problems) -> Node:
    """Parse ``KEY=VALUE`` into a mapping of one key."""
    key, equals, value = text.partition("=")
    source = Origin(f"--set {text}")
    if not equals or not key.strip():
        problems.add(source.name, "write KEY=VALUE, such as contour.degree=2")
        return Node({}, source)
    from ffseg.schema import strict_yaml

    count = len(problems.lines)
    node = strict_yaml.parse(value, source, problems)
    before, mark, _ = value.partition(" #")
    if mark and node == strict_yaml.parse(before, source, Problems()):
        problems.add(source.name, f"what follows ' #' is a comment and would be lost; quote it: {key}=\"{value}\"")
    return Node({key.strip(): node} if len(problems.lines) == count else {}, source)
