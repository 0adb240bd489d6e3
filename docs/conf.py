"""Sphinx: the site from the same Markdown that a repository's host shows. ``python docs/build.py`` builds it."""

import inspect
import re
import types

import ffseg

project = "ffseg"
author = "The ffseg maintainers"
copyright = "2026, the ffseg maintainers"  # noqa: A001 - Sphinx asks for this name
version = release = ffseg.__version__

root_doc = "README"
source_suffix = {".md": "markdown"}
exclude_patterns = ["paper"]
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax"]
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 4
suppress_warnings = ["misc.highlighting_failure"]
html_theme = "furo"
html_title = f"ffseg {version}"
html_show_sourcelink = False
autodoc_typehints = "none"  # the docstrings say shape and unit, the signatures the types
napoleon_use_ivar = True
templates_path: list[str] = []


def reference() -> str:
    """The page of the Python reference, made from the docstrings by autodoc instead of as plain text."""
    lines = ["# Python", "", "`import ffseg` gives all of these.", "", "```{eval-rst}"]
    for name in ffseg.__all__:
        item = getattr(ffseg, name)
        if name == "__version__" or isinstance(item, types.UnionType):
            continue
        kind = "autofunction" if inspect.isfunction(item) else "autoexception" if _is_error(item) else "autoclass"
        lines += [f".. {kind}:: ffseg.{name}", "   :members:" if kind == "autoclass" else "", ""]
    return "\n".join([*lines, "```"])


def contents(index: str) -> str:
    """The tables of contents that the first page's sections stand for."""
    parts = re.findall(r"^## (.+?)$(.*?)(?=^## |\Z)", index, flags=re.DOTALL | re.MULTILINE)
    trees = [(head, re.findall(r"^\| \[[^]]+\]\(([\w-]+)\.md\)", text, flags=re.MULTILINE)) for head, text in parts]
    return "".join(
        f"\n```{{toctree}}\n:hidden:\n:caption: {head}\n\n" + "\n".join(pages) + "\n```\n" for head, pages in trees
    )


def _is_error(item: object) -> bool:
    return inspect.isclass(item) and issubclass(item, Exception)


def setup(app) -> None:  # noqa: ANN001, D103 - Sphinx calls it
    def read(_app, page: str, source: list[str]) -> None:  # noqa: ANN001
        if page == "python":
            source[0] = reference()
        if page == root_doc:
            source[0] += contents(source[0])

    app.connect("source-read", read)
