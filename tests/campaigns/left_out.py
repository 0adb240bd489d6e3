"""How a prior does on drawn kinds it has not seen: ``python -m tests.campaigns.left_out [--looks 60] [--judged 30]``.

For each group of kinds that look alike, a forest is grown from all other kinds; its looks are then judged: the IoU of the pixels
where the odds are above even after neighbours have voted. A kind, a feature or a setting earns its place by the kinds that it is
not of. ``--out FILE`` writes a row a look, ``--before FILE`` says what has changed since and by how many standard errors: two
looks are at one picture, and count as one.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from batches import table

from ffseg.evidence import prior
from ffseg.evidence.forest import Forest
from ffseg.evidence.surroundings import STRIDE, voted
from ffseg.image.appearance import Appearance
from ffseg.io.files import write_bytes_atomic
from ffseg.io.images import prepare_worker
from ffseg.io.tables import csv_table
from ffseg.learning import grow
from ffseg.learning.drawn.sights import KINDS, STARTS, sights
from ffseg.learning.examples import known_pixels
from tests.campaigns import harness

GROUPS = (
    ("room", "corridor", "mirror"),
    ("street",),
    ("thing", "animal"),
    ("tissue", "nuclei", "colony"),
    ("field", "organ"),
)
"""Kinds that are left out together; a kind in none of them only teaches."""

UNSEEN = 300_000
"""Number of the first picture that is judged."""

COLUMNS = ("kind", "look", "iou")
Overlaps = dict[tuple[str, int], float]
"""By kind and number of a look."""


def main(
    looks: int = 60,
    judged_on: Annotated[int, typer.Option("--judged")] = 30,
    out: Path | None = None,
    before: Path | None = None,
) -> None:
    """Print the table."""
    prepare_worker()
    taught = {kind: list(learned(kind, looks)) for kind in KINDS}
    found: Overlaps = {}
    for group in GROUPS:
        others = [look for kind, own in taught.items() if kind not in group for look in own]
        forest = grow.grow(others, prior.FEATURE_NAMES, {}).inside
        found |= {(kind, look): overlap for kind in group for look, overlap in judged(kind, forest, judged_on)}
    for kind in dict.fromkeys(kind for kind, _ in found):
        print(f"{kind}: {np.mean([overlap for (own, _), overlap in found.items() if own == kind]):.3f}")
    print(f"all: {np.mean(list(found.values())):.4f} over {len(found)} looks")
    if out:
        write_bytes_atomic(out, csv_table(COLUMNS, [[*look, overlap] for look, overlap in found.items()]))
    if before:
        print(changed(found, {(row["kind"], int(row["look"])): float(row["iou"]) for row in table(before)}))


def learned(kind: str, count: int) -> Iterator[grow.Samples]:
    """What the prior that ships learns from the first looks at a kind."""
    for number, seen in enumerate(sights(kind, count)):
        yield grow.for_prior(seen, np.random.default_rng([*kind.encode(), number, 1]))


def judged(kind: str, forest: Forest, count: int) -> Iterator[tuple[int, float]]:
    """Numbers and IoU of so many looks at a kind."""
    for number, seen in enumerate(sights(kind, count, UNSEEN)):
        view = prior.start_features(Appearance(seen.image), seen.disc())
        odds = np.clip(forest.log_odds(prior.all_planes(view)), -prior.MAX_LOG_ODDS, prior.MAX_LOG_ODDS)
        known = known_pixels(seen.truth, view.factor)[::STRIDE, ::STRIDE]
        inside, truth = voted(odds, view)[known >= 0] > 0, known[known >= 0] > 0
        yield number, int(np.count_nonzero(inside & truth)) / max(1, int(np.count_nonzero(inside | truth)))


def changed(now: Overlaps, before: Overlaps) -> str:
    """The mean change of the looks that both have, and its standard error over pictures."""
    pictures: dict[tuple[str, int], list[float]] = {}
    for kind, look in now.keys() & before.keys():
        pictures.setdefault((kind, look // STARTS), []).append(now[kind, look] - before[kind, look])
    m = np.array([np.mean(changes) for changes in pictures.values()])
    return f"changed by {m.mean():+.4f}, standard error {m.std() / np.sqrt(len(m)):.4f}, {len(m)} pictures"


if __name__ == "__main__":
    harness.as_command(main)
