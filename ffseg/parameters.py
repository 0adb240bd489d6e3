"""The parameter set: the only home of defaults."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Point = tuple[float, float]
Circle = tuple[float, float, float]
Box = tuple[float, float, float, float]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Contour(_Section):
    """The free-form contour and its evolution."""

    degree: Annotated[int, Field(ge=1, le=6)] = 3
    patches: Annotated[int, Field(ge=3, le=100_000)] = 13
    split_threshold: Annotated[float, Field(ge=2, le=1000)] = 14.0
    balloon: Annotated[float, Field(ge=-16, le=16)] = 2.0
    refine: bool = True
    topology: bool = True
    clearance: Annotated[float, Field(ge=0, le=1000)] = 0.0
    settle: Annotated[float, Field(ge=0, le=16)] = 4.0
    max_iterations: Annotated[int, Field(ge=1, le=1_000_000)] = 2000


class Edges(_Section):
    """The edge map."""

    sigma: Annotated[float, Field(gt=0, le=20)] = 1.5
    exponent: Annotated[float, Field(ge=1, le=8)] = 2.0
    canny: tuple[NonNegative, NonNegative] | Literal["auto"] = "auto"


class Init(_Section):
    """Where the contour starts: one circle, or several circles, boxes, or the outlines in a mask image."""

    center: Point | Literal["auto"] = "auto"
    radius: Positive = 40.0
    circles: tuple[Circle, ...] = ()
    boxes: tuple[Box, ...] = ()
    mask: str | None = None


class Domain(_Section):
    """Where the contour may go."""

    mask: str | None = None


class Obstacles(_Section):
    """The structural test on enclosed components (Eq. 9)."""

    altitude: Positive = 0.08


class Snake(_Section):
    """The parametric snake (PM), Section 5.1."""


class LevelSet(_Section):
    """The fast-marching level set (LS), Eq. 12."""


class Parameters(_Section):
    """Everything that decides a segmentation."""

    method: str = "freeform"
    contour: Contour = Contour()
    edges: Edges = Edges()
    init: Init = Init()
    domain: Domain = Domain()
    obstacles: Obstacles = Obstacles()
    snake: Snake = Snake()
    levelset: LevelSet = LevelSet()
