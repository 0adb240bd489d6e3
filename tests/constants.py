"""The constants of the default path, read out of the sources: value, unit and provenance as they stand beside them."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "ffseg"

STEPS: dict[str, tuple[str, ...]] = {
    "starts": ("parameters.py", "starts/initial.py", "starts/sides.py", "starts/moved.py"),
    "size": ("image/magnified.py",),
    "domain": ("image/disc.py",),
    "evidence: the image's own edges": ("image/edges.py", "native/edges"),
    "evidence: auto": ("evidence/auto.py", "image/boundary.py"),
    "evidence: the prior": (
        "evidence/prior.py", "evidence/features.py", "evidence/surroundings.py", "evidence/maps.py",
        "image/appearance.py",
    ),
    "evidence: clicks and boxes": (
        "evidence/clicks.py", "evidence/hints.py", "evidence/box.py", "starts/rivals.py", "starts/boxes.py",
    ),
    "starts: further parts": ("starts/pockets.py", "starts/islands.py"),
    "contour": ("methods/freeform.py", "native/freeform"),
    "judge": ("judge.py",),
}  # fmt: skip
"""Files of each step, in the order in which an image meets them."""

_NATIVE = re.compile(
    r"^(?:inline |static )?constexpr (?:float|double|int|std::\w+) (k\w+) = ([^;]+);(?:\s*//\s*(.*))?$"
)


def constants() -> list[tuple[str, str, str, str, str]]:
    """Step, file, name, value and what stands beside it; where nothing does, it lays out memory or follows from others."""
    rows = [(step, *row) for step, places in STEPS.items() for place in places for row in _in(PACKAGE / place)]
    return [row for row in rows if row[4]]


def _in(place: Path) -> Iterator[tuple[str, str, str, str]]:
    files = [place] if place.is_file() else sorted([*place.rglob("*.hpp"), *place.rglob("*.cpp")])
    for file in files:
        name = file.relative_to(PACKAGE).as_posix()
        rows = _python(file) if file.suffix == ".py" else _native(file)
        for row in rows:
            yield name, *row


def _python(file: Path) -> Iterator[tuple[str, str, str]]:
    body = ast.parse(file.read_text("utf-8")).body
    for node, after in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.Assign):
            continue
        target = ast.unparse(node.targets[0]).strip("()")
        if not target.replace(",", "").replace(" ", "").isupper() or not _is_number(node.value):
            continue
        said = ""
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            said = " ".join(str(after.value.value).split())
        values = node.value.elts if isinstance(node.value, ast.Tuple) else [node.value]
        yield target, ", ".join(map(ast.unparse, values)), said


def _is_number(node: ast.expr) -> bool:
    """Whether an expression is made of numbers only."""
    allowed = (ast.Constant, ast.Tuple, ast.BinOp, ast.UnaryOp, ast.operator, ast.unaryop, ast.Load, ast.Name)
    if not all(isinstance(one, allowed) for one in ast.walk(node)):
        return False
    numbers = [one.value for one in ast.walk(node) if isinstance(one, ast.Constant)]
    return bool(numbers) and all(type(one) in (int, float) for one in numbers)


def _native(file: Path) -> Iterator[tuple[str, str, str]]:
    before: list[str] = []
    named = False  # what stands in `before` belongs to a constant, and to those right below it
    for line in file.read_text("utf-8").splitlines():
        found = _NATIVE.match(line.strip())
        if found:
            yield found[1], found[2], " ".join(filter(None, [*before, found[3]]))
        elif line.strip().startswith("// "):
            before = [line.strip()[3:]] if named else [*before, line.strip()[3:]]
        else:
            before = []
        named = found is not None


HEAD = ("| constant | value | where | what it is and where it comes from |", "| --- | --- | --- | --- |")


def table() -> str:
    """The constants as Markdown, a table a step."""
    parts, last = [], ""
    for step, file, name, value, said in constants():
        if step != last:
            parts += ["", f"### {step[0].upper()}{step[1:]}", "", *HEAD]
            last = step
        parts.append(f"| `{name}` | {value} | `{file}` | {said.replace('|', chr(92) + '|')} |")
    return "\n".join(parts[1:]) + "\n"
