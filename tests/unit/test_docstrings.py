"""Every public function and class has an example in its docstring, and it runs."""

import doctest
import inspect
import types
from pathlib import Path

import numpy as np
import pytest

import ffseg

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
PUBLIC = [n for n in ffseg.__all__ if n != "__version__" and not isinstance(getattr(ffseg, n), types.UnionType)]


def examples(name: str) -> list[doctest.DocTest]:
    """Examples of a public name, and of its own methods."""
    return doctest.DocTestFinder().find(getattr(ffseg, name), name, globs={"ffseg": ffseg, "np": np})


@pytest.mark.parametrize("name", PUBLIC)
def test_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "pictures").symlink_to(SAMPLES)
    monkeypatch.chdir(tmp_path)
    printed: list[str] = []
    for one in examples(name):
        doctest.DocTestRunner().run(one, out=printed.append)
    assert "".join(printed) == ""


def test_no_public_name_is_without_example() -> None:
    first = {name: inspect.getdoc(getattr(ffseg, name)) or "" for name in PUBLIC}
    assert [name for name, text in first.items() if "Examples\n--------\n" not in text or ">>> " not in text] == []
    assert [name for name, text in first.items() if "+SKIP" in text] == []


def test_an_example_that_is_wrong_is_noticed() -> None:
    wrong = doctest.DocTestParser().get_doctest(">>> 1 + 1\n3\n", {}, "wrong", None, None)
    assert doctest.DocTestRunner().run(wrong, out=lambda _: None).failed == 1
