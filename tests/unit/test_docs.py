"""The documentation: no dead link, no function it names is gone, pages made from docstrings are fresh."""

import inspect
import re
import types
import unicodedata
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import pytest

import ffseg
from ffseg.schema.sections import leaves

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
IDS = [str(page.relative_to(ROOT)) for page in PAGES]
PICTURES_KB = 2000
"""All pictures of the documentation together: what a clone has to carry."""


def without_code(text: str) -> str:
    return re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE)


def links(page: Path) -> list[str]:
    return re.findall(r"\]\(([^)\s]+)\)", without_code(page.read_text("utf-8")))


def anchors(page: Path) -> set[str]:
    """Anchors of the headings, as the usual renderers make them."""
    found = set()
    for heading in re.findall(r"^#+ +(.+)$", without_code(page.read_text("utf-8")), flags=re.MULTILINE):
        kept = (c for c in heading.lower() if c in " -_" or unicodedata.category(c)[0] in "LN")
        found.add("".join(kept).replace(" ", "-"))
    return found


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_no_link_is_dead(page: Path) -> None:
    dead = []
    for link in links(page):
        if re.match(r"[a-z]+:", link):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        if not target.is_file() or (anchor and anchor not in anchors(target)):
            dead.append(link)
    assert dead == []


def test_every_page_is_in_the_index() -> None:
    index = ROOT / "docs" / "README.md"
    assert {page.name for page in PAGES if page.parent == index.parent} - {"README.md"} <= set(links(index))


def test_every_picture_is_shown_somewhere_and_all_are_small() -> None:
    shown = {(page.parent / link).resolve() for page in PAGES for link in links(page)}
    pictures = [path for path in (ROOT / "docs" / "images").iterdir() if path.suffix != ".py"]
    assert [path.name for path in pictures if path.resolve() not in shown] == []
    assert sum(path.stat().st_size for path in pictures) < PICTURES_KB * 1000


def test_every_picture_of_the_gallery_names_the_file_it_is() -> None:
    page = (ROOT / "docs" / "gallery.md").read_text("utf-8")
    written = re.findall(r"^<!-- from (\w+)\S* -->\n!\[", page, flags=re.MULTILINE)
    assert len(written) == page.count("![")
    code = "".join(re.findall(r"^```.*?^```$", page, flags=re.DOTALL | re.MULTILINE))
    assert [name for name in written if name not in code] == []


def is_there(name: str) -> bool:
    """Whether a dotted name leads to something in the package."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        try:
            found: object = import_module(".".join(parts[:length]))
        except ImportError:
            continue
        for part in parts[length:]:
            if not hasattr(found, part):
                return False
            found = getattr(found, part)
        return True
    return False


def test_the_version_is_that_of_the_citation_and_of_a_section_of_the_changelog() -> None:
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    dated = re.search(rf"^version: {re.escape(ffseg.__version__)}\ndate-released: (\S+)$", citation, re.MULTILINE)
    assert dated
    assert f"\n## [{ffseg.__version__}] - {dated[1]}\n" in (ROOT / "CHANGELOG.md").read_text("utf-8")


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_what_a_page_names_exists(page: Path) -> None:
    text = without_code(page.read_text("utf-8"))
    names = re.findall(r"`(ffseg(?:\.\w+)+)", text)
    assert [name for name in names if not is_there(name)] == []
    files = re.findall(r"`(native/[\w./]+)`", text)
    assert [name for name in files if not (ROOT / "ffseg" / name).is_file()] == []
    keys = {key for key in leaves(ffseg.Parameters) if "." in key}
    sections = "|".join({key.partition(".")[0] for key in keys})
    keys |= {f"contour.{name}" for name in dir(ffseg.FreeForm)}  # a contour in Python is called that, too
    used = re.findall(rf"`((?:{sections})\.\w+)", text)
    assert [key for key in used if key not in keys and not key.endswith((".py", ".csv", ".json"))] == []


def test_python_page(golden: Callable[[Path, str], None]) -> None:
    head = "# Python\n\nMade from the docstrings by `pytest --update-golden`. `import ffseg` gives all of these."
    sections = [section(name, getattr(ffseg, name)) for name in ffseg.__all__ if name != "__version__"]
    golden(ROOT / "docs" / "python.md", "\n\n".join([head, *sections]) + "\n")


def section(name: str, item: object) -> str:
    """Signature and docstring of one public name, and of its public methods and properties."""
    if isinstance(item, types.UnionType):
        return f"## ffseg.{name}\n\n```text\n{str(item).replace('ffseg.parameters.', '')}\n```"
    assert item.__doc__, f"ffseg.{name} has no docstring"
    parts = [f"## ffseg.{name}\n\n{block(name, item)}"]
    if inspect.isclass(item) and not issubclass(item, Exception):
        own = [base for base in reversed(item.__mro__) if base.__module__.startswith("ffseg.")]
        members = {key: value for base in own for key, value in vars(base).items()}
        for member, value in members.items():
            shown = value.__func__ if isinstance(value, classmethod) else value
            if not member.startswith("_") and (inspect.isfunction(shown) or isinstance(shown, property)):
                parts.append(f"### ffseg.{name}.{member}\n\n{block(member, shown)}")
    return "\n\n".join(parts)


def block(name: str, item: object) -> str:
    head = f"{name}{signature(item)}\n\n" if inspect.isfunction(item) else ""
    return f"```text\n{head}{inspect.getdoc(item)}\n```"


def signature(function: Callable[..., object]) -> str:
    """One argument a line when it is long."""
    text = str(inspect.signature(function)).replace("'", "")
    return text if len(text) < 90 else re.sub(r", (?=\w+:|\*)", ",\n    ", text)
