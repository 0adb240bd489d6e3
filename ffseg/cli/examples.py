"""Examples that the help of each command ends with; the tests run them."""

from __future__ import annotations

EXAMPLES: dict[str, tuple[str, ...]] = {
    "run": (
        "ffseg run photos --out out --overlay --report",
        "ffseg run photos --out set --set contour.degree=2 --set edges.sigma=2",
        "ffseg run 'pictures/*.png' --out scored --truth pictures/truth --export coco,geojson",
        "ffseg run pictures/pair --out free --camera pictures/pair/camera.yaml --poses pictures/pair/poses.csv",
    ),
    "segment": (
        "ffseg segment pictures/simple.png simple.svg simple.png",
        "ffseg segment - - --as geojson < pictures/simple.png > simple.geojson",
    ),
    "pick": ("ffseg pick photos", "ffseg pick photos --out picked --labels road,kerb", "ffseg pick --review out"),
    "learn": (
        "ffseg learn own --truth masks --out own.ffmodel",
        "ffseg run own --out learned --set edges.model=own.ffmodel --truth masks",
    ),
    "tune": ("ffseg tune own --truth masks --out tuned.yaml --budget 3",),
    "domain": (
        "ffseg domain 'seen/pair*' --out own.png",
        "ffseg run 'seen/pair*' --out within --set domain.mask=own.png --set 'init.center=[400,450]'",
    ),
    "compare": (
        "ffseg compare pictures --out table --truth pictures/truth",
        "ffseg compare own --out peers --methods freeform,cv_edges_opened --truth masks --min-iou freeform=0.99",
    ),
    "bench": (
        "ffseg bench --out bench --suite scenes --images photos",
        "ffseg bench --out now --baseline bench/bench.json",
    ),
    "config": ("ffseg config list", "ffseg config show toy-full"),
    "config list": ("ffseg config list",),
    "config show": ("ffseg config show --set contour.degree=2 > mine.yaml",),
    "config check": ("ffseg config check mine.yaml",),
    "config schema": ("ffseg config schema > schema.json",),
    "samples": ("ffseg samples pictures", "ffseg samples seen --pairs 3"),
    "report": ("ffseg report out", "ffseg report out --images photos"),
    "merge": ("for i in 1 2 3; do ffseg run photos --out parts --shard $i/3; done; ffseg merge parts",),
}
"""By the words of the command; they use folders ``photos``, ``own`` with its ``masks``, samples in ``pictures`` and ``seen``."""


def epilog(command: str) -> str | None:
    """What stands below the options in the help of a command; None without an example."""
    lines = EXAMPLES.get(command)
    if not lines:
        return None
    return "\b\n" + "\n".join(["Examples:", *(f"  {line}" for line in lines)])
