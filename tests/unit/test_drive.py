"""The map and graph that a run makes of all its frames: as the frames' own map, whatever way the run took."""

import csv
import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
import shapely
from batches import table
from commands import Command
from rendered import drive, write_views

import ffseg
from ffseg.batch.outputs.table import MAP_FILES
from ffseg.parameter_files import ParametersLike
from ffseg.rendering.pairs import CAMERA_YAML
from ffseg.rendering.raycast import render
from ffseg.samples.drive import DRIVE_CAMERA, drive_camera, drive_poses, drive_scene

COUNT = 4
NAMES = [f"{number}.png" for number in range(COUNT)]


def write(folder: Path, lacking: int | None = None) -> None:
    """Images, camera and poses, of which one may lack."""
    write_views(folder, drive().views, drive().poses, NAMES, CAMERA_YAML + "footprint: 0.15\n")
    lines = (folder / "poses.csv").read_text().splitlines(keepends=True)
    (folder / "poses.csv").write_text("".join(line for line in lines if not line.startswith(f"{lacking}.png")))


def asked(folder: Path, out: str, *options: object) -> tuple[object, ...]:
    return ("run", folder / "views", "--camera", folder / "camera.yaml", "--map", "--out", folder / out, *options)


def fused(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in MAP_FILES}


def expected(folder: Path, *, posed: bool, params: ParametersLike = None) -> dict[str, bytes]:
    """The files of the map that the same frames make one after the other, without files between."""
    camera = ffseg.load_camera(folder / "camera.yaml")
    poses = ffseg.load_poses(folder / "poses.csv", NAMES, camera) if posed else {}
    sequence, grid = ffseg.Sequence(camera, params, mapped=True), ffseg.OccupancyMap()
    for name in NAMES:
        assert grid.add(sequence.feed(ffseg.read_image(folder / "views" / name), poses.get(name)), poses.get(name))
    ways = grid.skeleton(camera.footprint)
    return {f"map/{name}": data for name, data in (grid.files(ways) | ways.files()).items()}


def origins(out: Path) -> list[str]:
    return [row["origin"] for row in table(out / "map" / "trajectory.csv")]


@pytest.mark.parametrize("posed", [True, False])
def test_a_run_fuses_what_its_frames_show(ffseg_command: Command, tmp_path: Path, posed: bool) -> None:
    write(tmp_path)
    options = ("--poses", tmp_path / "poses.csv") if posed else ()
    done = ffseg_command(*asked(tmp_path, "out", *options, "--json"), code=0)
    figures = json.loads(done.stdout)["map"]
    assert (figures["frames"], figures["fused"], figures["estimated"]) == (COUNT, COUNT, 0 if posed else COUNT)
    assert 0.0 < figures["drift_m"] < (0.0005 if posed else 0.02), "what the ground told adds up and is said"
    assert figures == json.loads((tmp_path / "out" / "run.json").read_text())["map"]
    found, wanted = fused(tmp_path / "out"), expected(tmp_path, posed=posed)
    assert {name for name in found if found[name] != wanted[name]} == {"map/trajectory.csv"}
    rows, more = (list(csv.DictReader(files["map/trajectory.csv"].decode().splitlines())) for files in (found, wanted))
    assert [row["frame"] for row in rows] == NAMES
    assert rows == [row | {"frame": name} for row, name in zip(more, NAMES, strict=True)]
    features = json.loads(found["map/graph.geojson"])["features"]
    ways = [shapely.geometry.shape(one["geometry"]) for one in features if one["geometry"]["type"] == "LineString"]
    assert len(ways) == figures["edges"]
    graph = ElementTree.fromstring(found["map/graph.graphml"])[-1]  # noqa: S314 - our own file
    assert len(graph) == figures["nodes"] + figures["edges"]


def test_the_map_is_the_same_however_the_run_came_to_its_end(ffseg_command: Command, tmp_path: Path) -> None:
    write(tmp_path)
    assert ffseg_command(*asked(tmp_path, "whole")).returncode == 0
    whole = fused(tmp_path / "whole")
    (tmp_path / "whole" / "masks" / "2.png").unlink()
    (tmp_path / "whole" / "map" / "map.pgm").unlink()
    assert (ffseg_command(*asked(tmp_path, "whole")).returncode, fused(tmp_path / "whole")) == (0, whole)
    assert ffseg_command(*asked(tmp_path, "packed", "--pack", "tar")).returncode == 0
    assert fused(tmp_path / "packed") == whole
    for shard in ("1/2", "2/2"):
        assert ffseg_command(*asked(tmp_path, "parts", "--shard", shard)).returncode == 0
    assert "no map of all frames" in ffseg_command("merge", tmp_path / "parts", code=0).stderr
    assert not (tmp_path / "parts" / "map").exists()
    again = ffseg_command(*asked(tmp_path, "parts", "--json"))
    assert json.loads(again.stdout)["counts"]["unchanged"] == COUNT, "as the merge said: nothing is segmented again"
    assert fused(tmp_path / "parts") == whole
    cv2.imwrite(str(tmp_path / "views" / "3.png"), cv2.imread(str(tmp_path / "views" / "2.png")))
    less = [one for one in asked(tmp_path, "whole") if one != "--map"]
    assert "not in the map: 3.png: it was made without --map; run it again" in ffseg_command(*less, code=0).stderr
    ffseg_command("run", tmp_path / "views", "--out", tmp_path / "whole", "--overwrite", code=0)
    assert not any((tmp_path / "whole" / name).exists() for name in MAP_FILES), "no frame has a ground any more"


def test_a_run_remembers_what_its_domain_left_out(ffseg_command: Command, tmp_path: Path) -> None:
    write(tmp_path)
    camera, image = ffseg.load_camera(tmp_path / "camera.yaml"), ffseg.read_image(tmp_path / "views" / "0.png")
    domain = np.full(image.shape[:2], 255, np.uint8)
    domain[camera.height // 2 : camera.height // 2 + 20, : camera.width // 2] = 0
    cv2.imwrite(str(tmp_path / "domain.png"), domain)
    mask = tmp_path / "domain.png"
    options = ("--poses", tmp_path / "poses.csv", "--set", f"domain.mask={mask}")
    assert ffseg_command(*asked(tmp_path, "out", *options)).returncode == 0
    wanted = expected(tmp_path, posed=True, params={"domain": {"mask": str(mask)}})
    assert fused(tmp_path / "out")["map/map.pgm"] == wanted["map/map.pgm"]
    stood = json.loads((tmp_path / "out" / "ground" / "0.geojson").read_text())["camera"]
    assert sum(stood["left_out"]) == domain.size


def test_frames_that_are_not_in_the_map_are_named(ffseg_command: Command, tmp_path: Path) -> None:
    write(tmp_path, lacking=0)
    (tmp_path / "views" / "2.png").write_text("no image")
    done = ffseg_command(*asked(tmp_path, "out", "--poses", tmp_path / "poses.csv", "--report"), code=3)
    assert "not in the map: 0.png: it has no pose" in done.stderr
    assert "not in the map: 2.png: it failed" in done.stderr
    assert '"map": "data:image/webp' in (tmp_path / "out" / "report.html").read_text().replace('":"', '": "')
    assert origins(tmp_path / "out") == ["lost", "pose", "lost", "pose"]
    document = json.loads((tmp_path / "out" / "run.json").read_text())["map"]
    assert [one["image"] for one in document["lost"]] == ["0.png", "2.png"]
    assert (document["frames"], document["fused"]) == (COUNT, 2)
    alone = ffseg_command(*asked(tmp_path, "alone"), code=3)
    assert "not in the map: 2.png: it failed" in alone.stderr
    assert "not in the map: 3.png" not in alone.stderr, "it is placed by the motion since 1.png"
    notes = {row["image"]: row["note"] for row in table(tmp_path / "alone" / "timings.csv")}
    assert "the image before, 2.png cannot be used" in notes["3.png"]
    for number in (1, 3):
        (tmp_path / "views" / f"{number}.png").write_text("no image")
    none = ffseg_command(*asked(tmp_path, "out", "--poses", tmp_path / "poses.csv"))
    assert "not in the map: 0.png: it has no pose" in none.stderr
    assert "0 of 4 frames; nothing to show" in none.stdout
    assert not any((tmp_path / "out" / name).exists() for name in MAP_FILES)


def test_a_drive_over_open_ground_is_mapped_without_poses(ffseg_command: Command, tmp_path: Path) -> None:
    camera, scene = drive_camera(), replace(drive_scene(), boxes=(), marks=())
    poses = drive_poses()[:4]
    (tmp_path / "views").mkdir()
    for number, pose in enumerate(poses):
        cv2.imwrite(str(tmp_path / "views" / f"{number}.png"), render(scene, camera, pose, number, subsamples=1).image)
    (tmp_path / "camera.yaml").write_text(DRIVE_CAMERA)
    assert "not in the map" not in ffseg_command(*asked(tmp_path, "out"), code=0).stderr
    rows = table(tmp_path / "out" / "map" / "trajectory.csv")
    x, y, theta = poses[0]
    c, s = np.cos(theta), np.sin(theta)
    true = (np.array(poses)[:, :2] - [x, y]) @ np.array([[c, -s], [s, c]])
    assert np.abs(np.array([[float(row["x"]), float(row["y"])] for row in rows]) - true).max() < 0.02
    assert [row["pair"] for row in table(tmp_path / "out" / "timings.csv")] == ["first", "empty", "empty", "empty"]


def write_tum(folder: Path, rotations: list[tuple[float, ...]]) -> Path:
    lines = [
        f"{number} {x!r} {y!r} 0.9 {' '.join(map(repr, rotation))}\n"
        for number, ((x, y, _), rotation) in enumerate(zip(drive().poses[:COUNT], rotations, strict=True))
    ]
    (folder / "poses.txt").write_text("".join(lines))
    return folder / "poses.txt"


def test_a_trajectory_whose_z_points_up_is_that_of_the_map(ffseg_command: Command, tmp_path: Path) -> None:
    """The mirror is taken away by turning the images over; the ground is the same as seen from above."""
    write(tmp_path)
    assert ffseg_command(*asked(tmp_path, "mirrored", "--poses", tmp_path / "poses.csv")).returncode == 0
    for path in sorted((tmp_path / "views").iterdir()):
        cv2.imwrite(str(path), cv2.imread(str(path))[::-1])
    (tmp_path / "camera.yaml").write_text((tmp_path / "camera.yaml").read_text() + "mirrored: false\n")
    turns = [0.5 * theta for _, _, theta in drive().poses[:COUNT]]
    poses = write_tum(tmp_path, [(float(np.cos(turn)), float(np.sin(turn)), 0.0, 0.0) for turn in turns])
    assert ffseg_command(*asked(tmp_path, "up", "--poses", poses)).returncode == 0
    rows = table(tmp_path / "up" / "map" / "trajectory.csv")
    told = np.array([[float(row[key]) for key in ("x", "y", "theta")] for row in rows])
    off = told - np.array(drive().poses[:COUNT])
    assert np.abs(off[:, :2]).max() < 0.001
    assert np.abs(np.sin(off[:, 2])).max() < 0.001
    assert (np.cos(off[:, 2]) > 0).all()
    ours, theirs = (cv2.imread(str(tmp_path / out / "map" / "map.pgm"), -1) for out in ("up", "mirrored"))
    assert ((ours == 254) & (theirs == 254)).sum() > 0.97 * ((ours == 254) | (theirs == 254)).sum() > 1000


def test_frames_whose_poses_no_map_can_have_are_named(ffseg_command: Command, tmp_path: Path) -> None:
    write(tmp_path)
    poses = write_tum(tmp_path, [(0.5**0.5, 0.0, 0.0, 0.5**0.5)] * COUNT)
    done = ffseg_command(*asked(tmp_path, "out", "--poses", poses), code=0)
    for number, why in enumerate(["the camera's up is (0.00, 1.00, ", *["no motion"] * (COUNT - 1)]):
        assert f"not in the map: {number}.png: {why}" in done.stderr
    assert not any((tmp_path / "out" / name).exists() for name in MAP_FILES)
    assert len((tmp_path / "out" / "timings.csv").read_text().splitlines()) == 1 + COUNT


def test_poses_that_every_pair_refutes_make_no_map(ffseg_command: Command, tmp_path: Path) -> None:
    """Degrees for radians: the map had all frames, and no drift."""
    write(tmp_path)
    lines = [row.split(",") for row in (tmp_path / "poses.csv").read_text().splitlines()[1:]]
    rows = [f"{name},{x},{y},{float(np.rad2deg(float(theta)))!r}" for name, x, y, theta in lines]
    (tmp_path / "poses.csv").write_text("\n".join(["image,x,y,theta", *rows, ""]))
    done = ffseg_command(*asked(tmp_path, "out", "--poses", tmp_path / "poses.csv"), code=0)
    assert "not in the map: 1.png: no motion: " in done.stderr
    assert origins(tmp_path / "out") == ["pose", *["lost"] * (COUNT - 1)]


def test_a_pose_far_away_costs_its_frame_only(ffseg_command: Command, tmp_path: Path) -> None:
    write(tmp_path)
    lines = (tmp_path / "poses.csv").read_text().splitlines()
    (tmp_path / "poses.csv").write_text("\n".join([*lines[:2], "1.png,1e5,-1e5,0", *lines[3:], ""]))
    done = ffseg_command(*asked(tmp_path, "out", "--poses", tmp_path / "poses.csv"), code=0)
    assert "not in the map: 1.png: no motion: x and y of the poses look like millimetres" in done.stderr
    assert json.loads((tmp_path / "out" / "run.json").read_text())["map"]["fused"] == COUNT - 1
    assert origins(tmp_path / "out") == ["pose", "lost", "pose", "pose"]


def test_a_map_of_somebody_else_is_not_replaced(ffseg_command: Command, tmp_path: Path) -> None:
    write(tmp_path)
    (tmp_path / "out" / "map").mkdir(parents=True)
    (tmp_path / "out" / "map" / "map.yaml").write_text("image: mine.pgm\n")
    assert "map.yaml exists and no run made it" in ffseg_command(*asked(tmp_path, "out"), code=2).stderr
    assert np.array_equal(sorted(tmp_path.glob("out/*")), [tmp_path / "out" / "map"])
