"""Bags of ROS 1 and 2: a small one is made here, run, and what is written is read by the package that others read with."""

import json
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from commands import Command
from rendered import write_views
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from ffseg.camera.motion import robot_axes, robot_pose
from ffseg.errors import ImageReadError, UsageError
from ffseg.io import bags
from ffseg.io.images import decode_image
from ffseg.rendering.pairs import sample_camera
from ffseg.samples.drive import DRIVE_CAMERA, drive

COUNT, BEGIN, STEP = 4, 1_700_000_000_000_000_000, 100_000_000
TIMES = [BEGIN + number * STEP for number in range(COUNT)]


@lru_cache(maxsize=1)
def sight() -> Any:
    return drive(COUNT)


def written(path: Path, kind: str, messages: list[tuple[str, str, int, dict[str, Any]]]) -> Path:
    """A bag of messages: topic, type, time and fields."""
    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    plugin = {"storage_plugin": StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3, "version": 8}
    with Writer1(path) if kind == "ros1" else Writer(path, **plugin) as writer:
        topics = {}
        for topic, message, time, fields in messages:
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, message, typestore=store)
            made = store.types[message](**fields)
            packed = (store.serialize_ros1 if kind == "ros1" else store.serialize_cdr)(made, message)
            writer.write(topics[topic], time, packed)
    return path


def header(store: Any, time: int, frame: str, ros1: bool) -> Any:
    stamp = store.types["builtin_interfaces/msg/Time"](sec=time // 10**9, nanosec=time % 10**9)
    return store.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **({"seq": 0} if ros1 else {}))


def image(pixels: np.ndarray, encoding: str, head: Any, big: int = 0) -> dict[str, Any]:
    data = np.ascontiguousarray(pixels).view(np.uint8).ravel()
    height, width = pixels.shape[:2]
    return {"header": head, "height": height, "width": width, "encoding": encoding, "is_bigendian": big,
            "step": len(data) // height, "data": data}  # fmt: skip


def pose_fields(store: Any, x: float, y: float, turn: float) -> Any:
    kinds = store.types
    return kinds["geometry_msgs/msg/Pose"](
        position=kinds["geometry_msgs/msg/Point"](x=x, y=y, z=0.0),
        orientation=kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=np.sin(turn / 2), w=np.cos(turn / 2)),
    )


def transform(store: Any, time: int, pose: Any) -> tuple[str, str, int, dict[str, Any]]:
    """A message of ``/tf`` that says a pose."""
    moved = store.types["geometry_msgs/msg/Transform"](translation=pose.position, rotation=pose.orientation)
    led = store.types["geometry_msgs/msg/TransformStamped"](
        header=header(store, time, "odom", ros1=False), child_frame_id="base_link", transform=moved
    )
    return "/tf", "tf2_msgs/msg/TFMessage", time, {"transforms": [led]}


def a_drive(path: Path, kind: str, times: list[int] = TIMES) -> Path:
    """Images of the rendered drive with odometry at their times, under a mirror as the world lies."""
    ros1 = kind == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    kinds, messages = store.types, []
    still = kinds["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
    for view, pose, time in zip(sight().views, sight().poses, times, strict=True):
        head = header(store, time, "odom", ros1)
        where = kinds["geometry_msgs/msg/PoseWithCovariance"](pose=pose_fields(store, *pose), covariance=np.zeros(36))
        twist = kinds["geometry_msgs/msg/Twist"](linear=still, angular=still)
        speed = kinds["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=np.zeros(36))
        odometry = {"header": head, "child_frame_id": "base_link", "pose": where, "twist": speed}
        messages += [
            ("/camera/image", "sensor_msgs/msg/Image", time, image(view.image, "mono8", head)),
            ("/odom", "nav_msgs/msg/Odometry", time, odometry),
        ]
        messages += [transform(store, time, where.pose)] if not ros1 else []
    return written(path, kind, messages)


@pytest.mark.parametrize(
    ("kind", "name", "poses"), [("ros1", "d.bag", "/odom"), ("mcap", "d", "/tf"), ("db3", "d", "")]
)
def test_a_bag_runs_as_its_images_do(ffseg_command: Command, tmp_path: Path, kind: str, name: str, poses: str) -> None:
    bag, names = a_drive(tmp_path / name, kind), [f"camera_image_{number:06d}.png" for number in range(COUNT)]
    write_views(tmp_path, sight().views, sight().poses, names, DRIVE_CAMERA)
    options = ("--camera", tmp_path / "camera.yaml", "--map")
    asked = ("run", "--bag", bag, "--topic", "/camera/image", *options, *(("--poses", poses) if poses else ()))
    ffseg_command(*asked, "--out", tmp_path / "out", code=0)
    posed = ("--poses", tmp_path / "poses.csv") if poses else ()
    assert ffseg_command("run", tmp_path / "views", *options, *posed, "--out", tmp_path / "files").returncode == 0
    for path in (tmp_path / "files").rglob("*.p[gn]*"):
        assert (tmp_path / "out" / path.relative_to(tmp_path / "files")).read_bytes() == path.read_bytes(), path
    assert json.loads(ffseg_command(*asked, "--out", tmp_path / "out", "--json").stdout)["counts"]["unchanged"] == COUNT
    check_bag_out(tmp_path / "out", TIMES)


def test_images_of_one_time_have_a_scan_each(ffseg_command: Command, tmp_path: Path) -> None:
    times = [*TIMES[:2], *TIMES[1:3]]
    bag = a_drive(tmp_path / "d", "mcap", times)
    write_views(tmp_path, sight().views, sight().poses, [f"{number}.png" for number in range(COUNT)], DRIVE_CAMERA)
    asked = ("run", "--bag", bag, "--topic", "/camera/image", "--camera", tmp_path / "camera.yaml", "--map")
    ffseg_command(*asked, "--out", tmp_path / "out", code=0)
    check_bag_out(tmp_path / "out", times)


def check_bag_out(out: Path, times: list[int]) -> None:
    """The map and scans of the new bag against the files beside it."""
    with AnyReader([out / "map" / "drive.mcap"]) as reader:
        found = [(one.topic, time, reader.deserialize(data, one.msgtype)) for one, time, data in reader.messages()]
    scans = [one for one in found if one[0] == "/scan"]
    assert [time for _, time, _ in scans] == times
    for number, (_, _, scan) in enumerate(scans):
        stored = json.loads((out / "scans" / f"camera_image_{number:06d}.json").read_text())
        wanted = [np.inf if one is None else one for one in stored["ranges"]]
        assert scan.ranges.tolist() == pytest.approx(wanted, rel=1e-6)
        assert scan.angle_min + len(wanted) * scan.angle_increment == pytest.approx(np.pi, abs=1e-5)
    (_, _, grid), levels = next(one for one in found if one[0] == "/map"), cv2.imread(str(out / "map" / "map.pgm"), 0)
    cells = np.array(grid.data).reshape(grid.info.height, grid.info.width)[::-1]
    for cell, level in ((0, 254), (100, 0), (-1, 128)):
        assert np.array_equal(cells == cell, levels == level)
    place = grid.info.origin.position
    assert f"origin: [{place.x!r}, {place.y!r}" in (out / "map" / "map.yaml").read_text()


def test_every_encoding_is_the_image_it_was(tmp_path: Path) -> None:
    random, store = np.random.default_rng(1), get_typestore(Stores.ROS2_HUMBLE)
    colour = random.integers(0, 256, (5, 7, 3), np.uint8)
    deep = random.integers(0, 65536, (5, 7), np.uint16)
    alpha = np.dstack([colour, np.full((5, 7), 9, np.uint8)])
    head = header(store, BEGIN, "", ros1=False)
    packed = {"header": head, "format": "png", "data": cv2.imencode(".png", colour)[1].ravel()}
    messages = [("/c", "sensor_msgs/msg/CompressedImage", BEGIN, packed)]
    messages += [
        (topic, "sensor_msgs/msg/Image", BEGIN, image(pixels, name, head, big))
        for topic, name, pixels, big in [
            ("/i", "mono8", colour[..., 0], 0),
            ("/i", "bgr8", colour, 0),
            ("/i", "rgb8", colour[..., ::-1], 0),
            ("/i", "bgra8", alpha, 0),
            ("/i", "16UC1", deep, 0),
            ("/i", "mono16", deep.byteswap(), 1),
            ("/bad", "yuv422", colour, 0),
        ]
    ]  # all of one time, as a bag may hold them
    bag = written(tmp_path / "bag", "mcap", messages)
    wanted = [colour[..., 0], colour, colour, colour, deep, deep]
    for number in (3, 0, 5, 1, 4, 2):  # in any order
        data = bags.bag_image(f"{bag}::/i", number, 10_000)
        assert np.array_equal(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED), wanted[number]), number
        read = wanted[number] if number < 4 else np.rint(deep / 257.0)
        assert np.abs(decode_image(data, levels=None) - read).max() <= (0 if number < 4 else 1), number  # of rounding
    assert np.array_equal(cv2.imdecode(np.frombuffer(bags.bag_image(f"{bag}::/c", 0, 10_000), np.uint8), 1), colour)
    with pytest.raises(ImageReadError, match="none of mono8"):
        bags.bag_image(f"{bag}::/bad", 0, 10_000)
    with pytest.raises(ImageReadError, match="limit is 10 bytes"):
        bags.bag_image(f"{bag}::/i", 0, 10)


def test_what_is_not_there_is_named(tmp_path: Path, ffseg_command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = a_drive(tmp_path / "d.bag", "ros1")
    done = ffseg_command("run", "--bag", bag, "--topic", "/image", "--out", tmp_path / "out", code=2)
    assert "has no topic /image" in done.stderr
    assert "it has /camera/image" in done.stderr
    (tmp_path / "no.bag").write_bytes(b"no bag")
    with pytest.raises(UsageError, match="cannot be read as a bag"):
        bags.stamps(f"{tmp_path / 'no.bag'}::/i")
    monkeypatch.setattr("ffseg.plugins.find_spec", lambda _: None)
    with pytest.raises(UsageError, match=r"pip install 'ffseg\[ros\]'"):
        bags.stamps(f"{bag}::/camera/image")


@pytest.mark.parametrize(("kind", "damage"), [("db3", "rows"), ("mcap", "shifted"), ("mcap", "yaml")])
def test_a_damaged_bag_is_told_in_one_sentence(kind: str, damage: str, tmp_path: Path) -> None:
    """What parsers raise, of SQLite, of a size that the memory does not hold, and in several lines."""
    bag = a_drive(tmp_path / "d", kind)
    file = bag / ("metadata.yaml" if damage == "yaml" else f"d.{kind}")
    data = file.read_bytes()
    broken = {
        "rows": data[:0x7000] + b"\xff" * 0x1000 + data[0x8000:],
        "shifted": data[:9] + b"\xff" * 7 + data[9:],
        "yaml": b"a: b: c",
    }
    file.write_bytes(broken[damage])
    with pytest.raises(UsageError, match="cannot be read as a bag") as error:
        bags.stamps(f"{bag}::/camera/image")
    assert "\n" not in str(error.value)


def test_a_damaged_message_costs_its_image(tmp_path: Path) -> None:
    store, kind = get_typestore(Stores.ROS2_HUMBLE), "sensor_msgs/msg/Image"
    with Writer(tmp_path / "b", version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/i", kind, typestore=store)
        writer.write(topic, BEGIN, b"no message")
    with pytest.raises(ImageReadError, match="the bag cannot be read at image 0"):
        bags.bag_image(f"{tmp_path / 'b'}::/i", 0, 10_000)


def test_messages_that_name_no_pose_are_passed_over(tmp_path: Path) -> None:
    store, messages = get_typestore(Stores.ROS2_HUMBLE), []
    for number, (x, turn, length) in enumerate([(0.0, 0.0, 0.0), (1.0, 0.5, 1.0), (np.nan, 0.0, 1.0), (3.0, 0.7, 2.0)]):
        where, time = pose_fields(store, x, 2.0, turn), BEGIN + number * STEP
        where.orientation.z, where.orientation.w = length * where.orientation.z, length * where.orientation.w
        messages.append(transform(store, time, where))
    before, *poses = bags.bag_poses(f"{written(tmp_path / 'b', 'mcap', messages)}::/tf", [one[2] for one in messages])
    assert before is None
    assert np.ravel(poses) == pytest.approx([1, 2, 0.5, 2, 2, 0.6, 3, 2, 0.7])
    with pytest.raises(UsageError, match="has no pose in map, odom, world"):
        bags.bag_poses(f"{written(tmp_path / 'c', 'mcap', messages[:1])}::/tf", [BEGIN])


@pytest.mark.parametrize("mirrored", [True, False])
def test_a_robots_pose_is_its_cameras(mirrored: bool) -> None:
    """What the camera sees ahead lies ahead on the ground: of the frame of the poses y is left, or turned over."""
    lens = replace(sample_camera(), mirrored=mirrored, forward=30.0)
    pose = robot_pose(lens, 1.0, 2.0, 0.5)
    ahead = np.array([*(np.linalg.inv(robot_axes(lens)) @ [3.0, 0.5]), lens.mounting()])
    x, y, _ = pose.rotation @ lens.level().T @ ahead + pose.position
    c, s = np.cos(0.5), np.sin(0.5)
    wanted = np.array([1.0, 2.0]) + np.array([[c, -s], [s, c]]) @ [3.0, 0.5]
    np.testing.assert_allclose([x, y if mirrored else -y], wanted, atol=1e-9)
