"""Runs the commands and the Python code of the documentation, in a folder as a reader has it. Standard library only."""

import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
OWN_SAMPLES = ("README.md", "tutorial.md")
"""Pages that tell how to get the sample pictures; the others take them for granted."""
LEARNED_FROM = ("complex.png", "simple.png")
"""Of the samples: three take twice as long as two, and show nothing more."""
SHELLS = {"bash": ["bash", "-e", "-c"], "zsh": ["zsh", "-f", "-e", "-i", "-c"]}
"""An interactive zsh takes no comments and refuses patterns that match nothing, as when a line is pasted."""
_BLOCK = re.compile(
    r"(?:<!-- (not run|run with): ([^\n]+) -->\n)?^```(sh|python)\n(.*?)^```$(?:\n+```output\n(.*?)^```$)?",
    re.DOTALL | re.MULTILINE,
)
"""A mark that a block cannot be run here or needs a module, the block, and what it prints."""


@dataclass(frozen=True, slots=True)
class Block:
    """A piece of code of a page: language, code, what it prints where the page shows it, a module of an extra it needs."""

    language: str
    code: str
    output: str | None
    needs: str = ""


def blocks(page: Path) -> list[Block]:
    found = _BLOCK.findall(page.read_text("utf-8"))
    return [
        Block(language, code, output or None, reason if mark else "")
        for mark, reason, language, code, output in found
        if mark != "not run"
    ]


def pages() -> list[Path]:
    return [page for page in PAGES if blocks(page)]


def prepare(folder: Path, page: Path, scripts: Path) -> dict[str, str]:
    """Give a reader's folder photographs, masks, and the samples where the page supposes them; the environment."""
    photos = folder / "photos"
    photos.mkdir(parents=True)
    # of no name or size that a page may count on
    shutil.copyfile(ROOT / "samples" / "simple.png", photos / "IMG_0001.png")
    grey = bytes(200 if (x - 160) ** 2 + (y - 120) ** 2 < 6400 else 60 for y in range(240) for x in range(320))
    (photos / "street.pgm").write_bytes(b"P5 320 240 255\n" + grey)
    for name, source in (("masks", ROOT / "samples" / "truth"), ("own", ROOT / "samples")):
        (folder / name).mkdir()
        for image in LEARNED_FROM:
            shutil.copyfile(source / image, folder / name / image)
    environment = {**os.environ, "PATH": f"{scripts}{os.pathsep}{os.environ['PATH']}", "HOME": str(folder)}
    if page.name not in OWN_SAMPLES:  # the very bytes that the command writes
        shutil.copytree(ROOT / "samples", folder / "pictures")
    return environment


def run(block: Block, shell: str, folder: Path, environment: dict[str, str]) -> str:
    """Run a block; what is wrong, or empty, also where what it needs is not installed."""
    if block.needs and _without(block.needs, environment):
        return ""
    command = [*SHELLS[shell], block.code] if block.language == "sh" else ["python", "-c", block.code]
    places = {"cwd": folder, "env": environment, "stdin": subprocess.DEVNULL}
    done = subprocess.run(command, **places, capture_output=True, text=True, timeout=600, check=False)
    if done.returncode != 0:
        return f"exit code {done.returncode}\n{block.code}\n{done.stdout}{done.stderr}"
    if block.output is not None and _words(done.stdout) != _words(block.output):
        return f"printed something else\n{block.code}\n{done.stdout}"
    return ""


def _without(module: str, environment: dict[str, str]) -> bool:
    command = ["python", "-c", f"import importlib.util as u; raise SystemExit(u.find_spec({module!r}) is None)"]
    return subprocess.run(command, env=environment, check=False).returncode != 0


def _words(text: str) -> list[str]:
    """Words of an output, with every number taken for the same: times and versions differ."""
    return re.sub(r"\d+(\.\d+)*", "0", text).split()
