"""Outputs in metres of one image of a camera, as bytes."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

from ffseg.batch.outputs.encoding import Context, readable
from ffseg.freespace.birdseye import birds_eye
from ffseg.freespace.outline import Ground
from ffseg.result import Segmentation


def ground(_: Segmentation, context: Context) -> bytes:
    """Free space as GeoJSON polygons in metres."""
    return _json(_metres(context).document(readable(context.name)) | {"camera": context.camera})


def scan_csv(_: Segmentation, context: Context) -> bytes:
    """Ranges as a table."""
    text = io.StringIO(newline="")
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["bearing_deg", "range_m", "std_m", "end"])
    rows.writerows(_metres(context).scan().rows())
    return text.getvalue().encode("ascii")


def scan_json(_: Segmentation, context: Context) -> bytes:
    """Ranges with the fields of a laser scan."""
    return _json(_metres(context).scan().document())


def picture(_: Segmentation, context: Context) -> bytes:
    """The image from above as a PNG file."""
    return birds_eye(context.image, _metres(context))


def _metres(context: Context) -> Ground:
    if context.ground is None:
        raise AssertionError("outputs in metres are refused without a camera")
    return context.ground


def _json(document: dict[str, Any]) -> bytes:
    return json.dumps(document, separators=(",", ":"), allow_nan=False).encode("ascii")
