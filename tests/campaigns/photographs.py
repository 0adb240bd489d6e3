"""All methods on photographs: parameters chosen on half of the images, reported on the other half.

Run ``python -m tests.campaigns.photographs [--data DATA] [--methods a,b]``. DATA holds the folders of `SETS` as
`real_images` reads them; without them the campaign says so and does nothing. The images of a folder sorted by name, those at
even places choose and those at odd places are reported. Every method has a small grid of parameter sets; the one with the
highest mean IoU counts, once for each folder and once for both. An image that fails, or takes too long, counts as IoU 0.
"""

import os
import pickle
import resource
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from statistics import mean, median
from time import process_time
from typing import TypeVar

from ffseg.api import segment
from ffseg.errors import FfsegError
from ffseg.io.images import single_thread
from ffseg.methods.peers import configured
from ffseg.metrics import scores
from ffseg.parameters import load_params
from ffseg.peer_parameters import PeerParameters
from ffseg.plugins import PEERS, SEGMENTERS
from tests.campaigns import harness
from tests.campaigns.real_images import Photograph, load
from tests.real_data import data_folder

SETS = ("road", "seeded_objects")
SLOW = ("skimage_gac", "skimage_chan_vese", "skimage_snake", "cv_grabcut", "sitk_gac")
REPEAT, LONG_MS = 5, 200.0
"""Runs whose median processor time counts; one that takes longer than this is enough."""
LIMIT, SLOW_LIMIT = 5, 120
"""Seconds of processor time an image may take."""
T = TypeVar("T")

Setting = tuple[tuple[str, object], ...]
"""One parameter set: values by dotted key; for a peer the keys of its section."""

_SMOOTHING = (1.5, 2.5, 4.0)
_THRESHOLDS = (1.0, 2.0, 4.0, 8.0)
_CANNY = ("auto", (1.0, 2.0), (2.0, 4.0), (4.0, 8.0), (8.0, 16.0))

GRIDS: dict[str, dict[str, tuple[object, ...]]] = {
    "freeform": {"edges.sigma": _SMOOTHING, "edges.canny": _CANNY, "contour.clearance": (0.0, 16.0)},
    "snake": {"edges.sigma": _SMOOTHING, "edges.canny": _CANNY},
    "levelset": {"edges.sigma": _SMOOTHING, "edges.canny": _CANNY},
    "cv_floodfill": {"sigma": (0.8, 2.0, 4.0), "tolerance": (5, 10, 15, 20, 30, 50)},
    "cv_edges": {"sigma": (0.8, *_SMOOTHING), "threshold": _THRESHOLDS},
    "cv_edges_opened": {"sigma": (0.8, *_SMOOTHING), "threshold": _THRESHOLDS, "radius": (3.0, 6.0)},
    "cv_watershed": {"sigma": (0.8, 2.0, 4.0, 8.0)},
    "sitk_fast_marching": {"sigma": (0.8, 2.5), "threshold": _THRESHOLDS},
    "skfmm": {"sigma": (0.8, 2.5), "threshold": _THRESHOLDS},
    "sitk_gac": {"threshold": (1.0, 2.0, 4.0)},
    "cv_grabcut": {"iterations": (5,)},
    "skimage_snake": {"sigma": (3.0,)},
    "skimage_chan_vese": {"iterations": (40,)},
    "skimage_gac": {"iterations": (200,)},
}
"""Values tried, by method and key; the product of a method's values is its grid. The slowest have one: their default."""


@dataclass(frozen=True)
class Result:
    """A method's figures on the reported half of a folder: IoU, boundary F and milliseconds of each image."""

    folder: str
    method: str
    chosen_on: str
    setting: Setting
    chosen_iou: float
    rows: tuple[tuple[float, float, float], ...]

    def line(self) -> str:
        """Row of a table."""
        overlaps, edges, times = zip(*self.rows, strict=True)
        cells = [f"{value:.3f}" for value in (self.chosen_iou, mean(overlaps), median(overlaps), mean(edges))]
        spent = median([ms for ms in times if ms == ms] or [float("nan")])
        return f"| {self.method} | `{shown(self.setting)}` | {' | '.join(cells)} | {spent:.1f} |"


def main(data: Path = data_folder(), methods: str = ",".join(GRIDS)) -> int:
    """Run the campaign; 0 also when the photographs are absent."""
    folders = {folder: list(load(data, [folder])) for folder in SETS}
    if not all(folders.values()):
        print(f"skipped: {data} has no {' and '.join(SETS)} with seeds.csv; name the folder with --data")
        return 0
    single_thread()
    results: list[Result] = []
    for method in methods.split(","):
        if method in SEGMENTERS or (method in PEERS and PEERS[method].installed):
            results += examined(method, folders)
            print(f"{method}: done", flush=True)
        else:
            print(f"skipped: {method} is not installed, or there is none")
    print(markdown(results))
    return 0


def examined(method: str, folders: Mapping[str, Sequence[Photograph]]) -> Iterator[Result]:
    """Choose on the even places, report on the odd ones."""
    keys = GRIDS[method]
    choices: list[Setting] = [tuple(zip(keys, values, strict=True)) for values in product(*keys.values())]
    tried = {choices[0]: dict.fromkeys(SETS, float("nan"))}
    if len(choices) > 1:
        tried = {
            setting: {
                folder: mean(figures(method, setting, one, 0)[0] for one in folders[folder][::2]) for folder in SETS
            }
            for setting in choices
        }
    common = max(tried, key=lambda setting: mean(tried[setting].values()))
    for folder in SETS:
        own = max(tried, key=lambda setting: tried[setting][folder])
        for chosen_on, setting in ((folder, own), ("both", common)):
            rows = tuple(figures(method, setting, one, REPEAT) for one in folders[folder][1::2])
            yield Result(folder, method, chosen_on, setting, tried[setting][folder], rows)


def figures(method: str, setting: Setting, one: Photograph, repeat: int) -> tuple[float, float, float]:
    """IoU, boundary F and median milliseconds; nothing of an image that cannot be segmented, or not in time."""
    most = SLOW_LIMIT if method in SLOW else LIMIT
    return limited(partial(_figures, method, setting, one, repeat), most) or (0.0, 0.0, float("nan"))


def _figures(method: str, setting: Setting, one: Photograph, repeat: int) -> tuple[float, float, float] | None:
    params, peers = load_params(), PeerParameters()
    if method in PEERS:
        peers = replace(peers, **{method: replace(getattr(peers, method), **dict(setting))})
    else:
        params = load_params(None, dict(setting))
    params, options = configured(one.placed(params), method, peers)
    spent: list[float] = []
    try:
        mask = segment(one.image, params, method, options=options).mask
        while len(spent) < repeat and (not spent or spent[-1] <= LONG_MS):
            begin = process_time()
            segment(one.image, params, method, options=options)
            spent.append((process_time() - begin) * 1e3)
    except FfsegError:
        return None
    found = scores(mask, one.truth)
    return found.iou, found.boundary_f or 0.0, median(spent or [0.0])


def limited(work: Callable[[], T], seconds: int) -> T | None:
    """What `work` returns, computed in a child process; None when it takes more processor time than this."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        with os.fdopen(writer, "wb") as pipe:
            pickle.dump(work(), pipe)
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        data = pipe.read()
    status = os.waitpid(child, 0)[1]
    return pickle.loads(data) if status == 0 else None  # from our own process


def shown(setting: Setting) -> str:
    """A parameter set as a user would write it."""
    texts = {
        key: f"[{','.join(f'{v:g}' for v in value)}]" if isinstance(value, tuple) else value for key, value in setting
    }
    return " ".join(f"{key}={text}" for key, text in texts.items())


def markdown(results: list[Result]) -> str:
    """Tables for reading: for each folder and choice one line a method, best mean IoU first."""
    lines: list[str] = []
    for folder, chosen_on in ((one, choice) for one in SETS for choice in (one, "both")):
        lines += ["", f"### {folder}: parameters chosen on the other half of {chosen_on}", "", *_HEAD]
        own = [one for one in results if (one.folder, one.chosen_on) == (folder, chosen_on)]
        lines += [one.line() for one in sorted(own, key=lambda one: -mean(row[0] for row in one.rows))]
    return "\n".join(lines)


_HEAD = (
    "| method | parameters | mean IoU where chosen | mean IoU | median IoU | boundary F 2 px | ms |",
    "| --- | --- | --: | --: | --: | --: | --: |",
)


if __name__ == "__main__":
    harness.as_command(main)
