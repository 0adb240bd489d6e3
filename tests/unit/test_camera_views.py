"""What a run over views needs: pairing, rows, overlays, and values that can be sent to a worker."""

import pickle
from pathlib import Path

import numpy as np
import pytest
from rendered import render_pair, write_pair

from ffseg.batch.views import CameraSetup, load_views, neighbours
from ffseg.batch.workers.frames import EarlierImages, evidence_lines, merged_segmentation, obstacle_rows, overlay_lines
from ffseg.io.images import Limits
from ffseg.io.masks import encode_png
from ffseg.parameter_files import load_params
from ffseg.scene import Scene


def test_neighbours_follow_within_their_folder() -> None:
    names = ["a/1.png", "b/1.png", "a/2.png", "b/2.png", "a/3.png", "c.png"]
    assert neighbours(names) == {"a/2.png": "a/1.png", "b/2.png": "b/1.png", "a/3.png": "a/2.png"}


def test_a_pair_becomes_rows_lines_and_a_merged_mask(tmp_path: Path) -> None:
    write_pair(tmp_path)
    camera, poses = str(tmp_path / "camera.yaml"), str(tmp_path / "poses.csv")
    views: CameraSetup = pickle.loads(pickle.dumps(load_views(camera, poses, None, ["1.png", "2.png"])))
    pair = render_pair(4)
    previous = encode_png(pair.previous.image, [])
    frame = EarlierImages(views, "2.png", [previous], Limits()).frame(Scene(pair.current.image, load_params()))
    rows = obstacle_rows(frame)
    assert {row["verdict"] for row in rows} == {"obstacle", "false_obstacle"}
    assert all(r["max_altitude_m"] == pytest.approx(0, abs=0.08) for r in rows if r["verdict"] == "false_obstacle")
    merged = merged_segmentation(frame)
    assert (merged.mask & pair.current.truth).sum() / (merged.mask | pair.current.truth).sum() > 0.985
    assert {line.kind for line in overlay_lines(frame, 0.1)} == {"outer", "obstacle", "false"}
    drawn = evidence_lines(frame)
    assert {line.kind for line in drawn} >= {"agrees", "differs"}
    assert len(frame.samples) > 0
    # A dot and a residual for each point that agrees, a dot for each that differs, two strokes for each sample.
    assert len(drawn) == len(frame.fit.inliers) + frame.fit.count + 2 * len(frame.samples)
    places = [line.points.mean(axis=0) for line in drawn if len(line.points) == 4]
    assert np.array(places) == pytest.approx(frame.fit.tracks.current)
    first = EarlierImages(views, "1.png", [], Limits()).frame(Scene(pair.previous.image, load_params()))
    assert {row["verdict"] for row in obstacle_rows(first)} == {"untested"}
    assert {row["max_altitude_m"] for row in obstacle_rows(first)} == {""}
