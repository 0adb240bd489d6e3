"""Damaged files of one format, read by ffseg, Pillow and libvips: how often what ffseg reads is something else.

Run by ``bad_files.py`` as a process of its own for each format, which a crash of a decoder may end: one line of JSON for
each file, the name first.
"""

import json
import re
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

KINDS = ("whole", "header", "tail", "cut", "bit", "hole")


@dataclass
class Share:
    """What became of the files of one format, by kind of damage.

    Attributes
    ----------
    files, accepted : Counter of str
    alone : Counter of str
        Accepted, while neither Pillow nor libvips reads the file.
    differs : Counter of str
        Accepted, and neither of the two that read it has these pixels.
    changed : Counter of str
        Accepted, and the pixels are not those of the whole file: what no reader can tell.
    slowest_ms, largest_mb : (float, str)
    crashed : list of str
    """

    files: Counter[str] = field(default_factory=Counter)
    accepted: Counter[str] = field(default_factory=Counter)
    alone: Counter[str] = field(default_factory=Counter)
    differs: Counter[str] = field(default_factory=Counter)
    changed: Counter[str] = field(default_factory=Counter)
    slowest_ms: tuple[float, str] = (0.0, "")
    largest_mb: tuple[float, str] = (0.0, "")
    crashed: list[str] = field(default_factory=list)

    def count(self, line: dict[str, Any]) -> None:
        """Count one file."""
        kind = line["kind"]
        self.files[kind] += 1
        self.slowest_ms = max(self.slowest_ms, (line["ms"], line["name"]))
        self.largest_mb = max(self.largest_mb, (line["mb"], line["name"]))
        if line["reason"]:
            return
        self.accepted[kind] += 1
        self.alone[kind] += line["others"] == []
        self.differs[kind] += bool(line["others"]) and not any(line["others"])
        self.changed[kind] += line["changed"]

    def cells(self) -> list[str]:
        """Accepted files, those of other pixels than a reference, and those no longer the whole file's, by kind."""
        return [f"{self.accepted[kind]}/{self.files[kind]}" for kind in KINDS[1:]]


def lines(name: str, headers: int) -> Iterator[dict[str, Any]]:
    """Read every damaged file of a source; the name is given before the file is read."""
    import damage
    import readings

    data, _ = damage.sources()[name]
    tolerance, whole = damage.tolerance(name), readings.pillow(data)
    for item in damage.damaged(name, data, headers):
        yield {"name": item.name}
        image, line = _read(item.data)
        line |= {"name": item.name, "kind": item.kind}
        if image is not None:
            others = [reading for read in (readings.pillow, readings.vips) if (reading := read(item.data)) is not None]
            line["others"] = [readings.same(image, other, tolerance) for other in others]
            line["changed"] = whole is None or not readings.same(image, whole, tolerance)
        yield line


def _peak_kb() -> int:
    found = re.search(r"VmHWM:\s+(\d+)", Path("/proc/self/status").read_text())
    return int(found[1]) if found else 0


def _read(data: bytes) -> tuple[Any, dict[str, Any]]:
    from ffseg.errors import ImageReadError
    from ffseg.io.images import decode_image

    Path("/proc/self/clear_refs").write_text("5")  # forget the peak of what was read before
    base, begin = _peak_kb(), time.perf_counter()
    image, reason = None, ""
    try:
        image = decode_image(data)
    except ImageReadError as error:
        reason = error.reason
    spent = (time.perf_counter() - begin) * 1e3
    return image, {"reason": reason, "ms": spent, "mb": (_peak_kb() - base) / 1e3}


def share_of(name: str, output: str, code: int) -> Share:
    """Figures from what the process of a format has printed, and its exit code."""
    share = Share()
    last = ""
    for text in output.splitlines():
        line = json.loads(text)
        last = line["name"]
        if "ms" in line:
            share.count(line)
    if code != 0:
        share.crashed.append(f"{last or name}: exit {code}")
    return share


def table(shares: dict[str, Share]) -> str:
    """Figures of all formats as a Markdown table: accepted of each kind of damage, then what became of all accepted."""
    head = ["format", *KINDS[1:], "alone", "differ", "changed", "slowest ms", "largest MB"]
    rows = [head, ["---"] * len(head)]
    for name, share in shares.items():
        sums = [str(sum(counter.values())) for counter in (share.alone, share.differs, share.changed)]
        rows.append([name, *share.cells(), *sums, f"{share.slowest_ms[0]:.1f}", f"{share.largest_mb[0]:.1f}"])
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


if __name__ == "__main__":
    for made in lines(sys.argv[1], int(sys.argv[2])):
        print(json.dumps(made), flush=True)
