"""Inputs and rows of a comparison."""

from __future__ import annotations

from dataclasses import dataclass, fields

from ffseg.batch.plan.sources import Job
from ffseg.parameters import Parameters
from ffseg.peer_parameters import PeerParameters


@dataclass(frozen=True, slots=True)
class Row:
    """One method on one image; None stands for what is not known. `status` is ok, failed or skipped.

    `source` is what told where edges are, `start_moved` says yes where the method did not start as asked.
    """

    image: str
    method: str
    initial_points: int | None = None
    final_points: int | None = None
    iterations: int | None = None
    edges_ms: float | None = None
    evolve_ms: float | None = None
    total_ms: float | None = None
    iou: float | None = None
    boundary_mean_px: float | None = None
    boundary_max_px: float | None = None
    holes: int | None = None
    status: str = "ok"
    error: str = ""
    boundary_f_2px: float | None = None
    source: str = ""
    start_moved: str = ""


COLUMNS = tuple(column.name for column in fields(Row))
"""Of ``compare.csv``."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """What is to be compared.

    Attributes
    ----------
    repeat : int
        Runs of each method on each image; the median time counts.
    truth_label : int or None
        Number that means inside in true masks; None for 255.
    own_edges : bool
        Every method has an edge map and starts of its own, as in a run; else all have those of one.
    """

    jobs: tuple[Job, ...]
    out: str
    methods: tuple[str, ...]
    params: Parameters
    peers: PeerParameters
    repeat: int = 1
    truth_label: int | None = None
    own_edges: bool = False
