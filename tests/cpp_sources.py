"""What the house rules ask of C++ sources: functions and classes with their sizes, by matching braces."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

NOISE = re.compile(
    r"//[^\n]*|/\*.*?\*/|^[ ]*#(?:\\\n|[^\n])*"
    r'|R"\((?:.*?)\)"|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])\'',
    re.S | re.M,
)
"""Comments, texts, characters and preprocessor lines."""
CLASS = re.compile(r"\b(class|struct|union)\s+(?:FFSEG_\w+\s+)?(\w+)(?:\s*final)?(?:\s*:[^;{]*)?\s*$")
ENUM = re.compile(r"\benum\s+(?:class\s+)?(\w+)[^;{}]*$")
NAMESPACE = re.compile(r"\bnamespace(?:\s+([\w:]+))?\s*$")
FUNCTION = re.compile(
    r"([\w:~<>]+|operator\S+|\])\s*\((?:[^()]|\((?:[^()]|\([^()]*\))*\))*\)\s*"
    r"(?:const\s*|noexcept\s*|override\s*|mutable\s*|->\s*[\w:<>&*, ]+\s*)*(?::(?!:)[^;]*)?$"
)
NO_MEMBER = ("class ", "enum ", "using ", "friend ", "static_assert", "static constexpr", "template")
CONTROL = {"if", "for", "while", "switch", "catch", "constexpr"}


@dataclass
class Block:
    """What stands between two braces."""

    kind: str  # namespace, class, enum, function or other
    name: str
    begin: int  # line of the head's last part
    end: int = 0
    parents: tuple[Block, ...] = ()
    head: str = ""
    statements: list[str] = field(default_factory=list)

    @property
    def lines(self) -> int:
        return self.end - self.begin + 1

    @property
    def members(self) -> int:
        """Declared names: functions, and every one of several variables in a declaration; constants do not count."""
        return sum(declared(text) for text in self.statements)

    @property
    def namespace(self) -> str:
        """Of the namespaces round it; anonymous ones are named so."""
        return "::".join(parent.name for parent in self.parents if parent.kind == "namespace")


@cache
def blocks(path: Path) -> tuple[Block, ...]:
    """Every pair of braces of a file, inner ones first."""
    text = NOISE.sub(lambda found: "\n" * found[0].count("\n") or " ", path.read_text("utf-8"))
    open_blocks: list[Block] = []
    found: list[Block] = []
    head, line = "", 1
    for mark in re.split(r"([{};\n])", text):
        if mark == "\n":
            line += 1
            head += " "
        elif mark == "{":
            made = block_of(head.strip(), line, tuple(open_blocks))
            if open_blocks and made.kind in ("function", "class", "enum"):
                open_blocks[-1].statements.append(f"{made.kind} {head.strip()}")
            made.head = head
            open_blocks.append(made)
            head = ""
        elif mark == "}":
            done = open_blocks.pop()
            done.end = line
            found.append(done)
            in_class = bool(open_blocks) and open_blocks[-1].kind == "class"
            head = done.head if done.kind == "other" and in_class else ""  # int x{1}, y;
        elif mark == ";":
            if open_blocks and head.strip():
                open_blocks[-1].statements.append(head.strip())
            head = ""
        else:
            head += mark
    assert not open_blocks, f"{path}: braces do not match"
    return tuple(found)


def block_of(head: str, line: int, parents: tuple[Block, ...]) -> Block:
    head = re.sub(r"\b(public|private|protected)\s*:", "", head).strip()
    if found := NAMESPACE.search(head):
        return Block("namespace", found[1] or "(anonymous)", line, parents=parents)
    if found := ENUM.search(head):
        return Block("enum", found[1], line, parents=parents)
    if found := CLASS.search(re.sub(r"template\s*<[^{]*?>\s*(?=class|struct)", "", head)):
        return Block("class", found[2], line, parents=parents)
    if (found := FUNCTION.search(head)) and found[1] not in CONTROL:
        return Block("function", found[1], line - head.count("\n"), parents=parents)
    return Block("other", "", line, parents=parents)


def declared(statement: str) -> int:
    """Names that a statement of a class declares."""
    text = re.sub(r"\b(public|private|protected)\s*:", "", statement).strip()
    if text.startswith("function "):
        return 1
    if not text or text.startswith(NO_MEMBER):
        return 0
    plain = re.sub(r"<[^<>]*(?:<[^<>]*>[^<>]*)*>|\([^()]*\)", "", text)
    return plain.count(",") + 1
