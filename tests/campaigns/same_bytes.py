"""R9: the same bytes for any number of workers, order of the images, time zone, locale and hash seed.

``python -m tests.campaigns.same_bytes --work DIR --images 500``
"""

import shutil
from dataclasses import dataclass, field

from tests.campaigns import harness

VARIANTS: dict[str, tuple[int, int, dict[str, str]]] = {
    "one": (1, 1, {}),
    "two": (2, 1, {"TZ": "Asia/Kathmandu", "PYTHONHASHSEED": "1"}),
    "four, backwards": (4, -1, {"LC_ALL": "tr_TR.UTF-8", "LANG": "de_DE", "PYTHONHASHSEED": "2"}),
    "C": (1, 1, {"LC_ALL": "C", "TZ": "UTC+12", "PYTHONUTF8": "0"}),
}
"""Workers, order and environment."""


@dataclass
class Figures:
    """Files of the first variant, and what differs from them."""

    variants: int = 0
    files: int = 0
    differ: list[str] = field(default_factory=list)


def campaign(work: harness.Work, images: int = 500) -> Figures:
    """Run every variant over the same images and compare masks, contours and overlays."""
    source, figures = work / "in", Figures()
    harness.draw_blobs(source, images)
    files, first = sorted(source.iterdir()), dict[str, bytes]()
    for name, (jobs, step, env) in VARIANTS.items():
        out = work / "out"
        shutil.rmtree(out, ignore_errors=True)
        options = ("--out", out, "--jobs", str(jobs), "--overlay", "--set", harness.CONFIG, "-q")
        ended = harness.run("run", *files[::step], *options, env=env)
        assert ended.code == 0, ended.stderr
        found = harness.outputs(out)
        found |= {f"overlays/{path.name}": path.read_bytes() for path in (out / "overlays").iterdir()}
        first = first or found
        figures.variants += 1
        figures.differ += [f"{name}: {f}" for f in sorted(first.keys() | found) if first.get(f) != found.get(f)]
    figures.files = len(first)
    return figures


if __name__ == "__main__":
    harness.as_command(campaign)
