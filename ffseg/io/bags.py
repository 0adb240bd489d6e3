"""Bags of ROS 1 and 2 (rosbags): images of a topic, poses of odometry or transforms, maps and scans into a new bag.

A topic of a bag is named as one path, ``drive.bag::/camera/image``; its images have numbers, as the frames of a film.
"""

from __future__ import annotations

import atexit
import itertools
import math
import os
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

from ffseg.errors import FfsegError, ImageReadError, UsageError, said
from ffseg.io.files import printable
from ffseg.plugins import require

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ffseg.arrays import Image

MARK = "::/"
"""Between a bag and a topic."""
_IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
_ODOMETRY, _TRANSFORMS = "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
_WORLDS = ("map", "odom", "world")
"""Frames that a transform leads from, the most wanted first."""
_LAYOUTS = {"mono8": 1, "8UC1": 1, "bgr8": 3, "rgb8": 3, "8UC3": 3, "bgra8": 4, "rgba8": 4, "mono16": 1, "16UC1": 1}
"""Channels of an image's encoding; those with 16 have two bytes a sample."""
_WRITTEN = {"/map": "nav_msgs/msg/OccupancyGrid", "/scan": "sensor_msgs/msg/LaserScan"}
_NANO = 1_000_000_000
Planar = tuple[float, float, float]


def in_bag(path: str) -> bool:
    """Whether a path names a topic of a bag."""
    return MARK in path


def bag_of(path: str) -> str:
    """The bag of such a path; another path as it is."""
    return path.partition(MARK)[0]


def stamps(path: str) -> list[int]:
    """Nanoseconds of each image of a topic.

    Raises
    ------
    UsageError
        Naming what is not there: the package, the bag, or the topic with those that are.
    """
    with _opened(path, _IMAGES) as (reader, connections):
        return [time for _, time, _ in reader.messages(connections)]


def bag_image(path: str, number: int, max_bytes: int) -> bytes:
    """An image of a topic as the bytes of an image file.

    Raises
    ------
    ImageReadError
        If there is no such image, or it cannot be decoded.
    """
    try:
        status = os.stat(bag_of(path))
        reader = _reader(path, (status.st_size, status.st_mtime_ns))
        return reader.image(number, max_bytes)
    except (ImageReadError, MemoryError):
        raise
    except Exception as error:  # rosbags, and what it reads with, raise whatever they come upon
        raise ImageReadError("unreadable", f"the bag cannot be read at image {number} ({said(error)})") from error


class _Reader:
    """A topic that stays open: its images are asked for by number, in any order."""

    def __init__(self, path: str) -> None:
        self._times, self._stack, self._lock = stamps(path), ExitStack(), Lock()
        self._bag, self._connections = self._stack.enter_context(_opened(path, _IMAGES))
        atexit.register(self._stack.close)  # when the interpreter is gone it is too late

    def image(self, number: int, max_bytes: int) -> bytes:
        """As `bag_image`."""
        time = self._times[number]
        with self._lock:
            found = self._bag.messages(self._connections, start=time, stop=time + 1)
            connection, _, data = next(itertools.islice(found, number - bisect_left(self._times, time), None))
            return _encoded(self._bag.deserialize(data, connection.msgtype), max_bytes)


@lru_cache(maxsize=1)
def _reader(path: str, _mark: tuple[int, int]) -> _Reader:
    """The reader of a topic, kept while its bag is the same."""
    return _Reader(path)


def bag_poses(path: str, times: Iterable[int]) -> list[Planar | None]:
    """x, y (metres) and heading (radians, counterclockwise) of the robot at times, linear between the messages of a topic.

    None before the first and after the last. Of transforms those from ``map``, ``odom`` or ``world`` count. Messages whose
    numbers are not finite, or whose quaternion is zero, as before a robot knows where it is, are passed over.
    """
    import numpy as np

    found: dict[str, list[tuple[int, Planar]]] = {}
    with _opened(path, (_ODOMETRY, _TRANSFORMS)) as (reader, connections):
        for connection, time, data in reader.messages(connections):
            message: Any = reader.deserialize(data, connection.msgtype)
            for frame, where in _placed(message):
                if all(map(math.isfinite, where)):
                    found.setdefault(frame, []).append((time, where))
    origin = next((one for one in (*_WORLDS, "") if one in found), None)
    if origin is None:
        topic = f"the topic /{printable(path.partition(MARK)[2])} of {printable(bag_of(path))}"
        raise UsageError(f"{topic} has no pose in {', '.join(_WORLDS)}; name a topic of odometry")
    at = np.array([time for time, _ in found[origin]], np.int64)
    x, y, turn = np.array([where for _, where in found[origin]]).T
    turn, first = np.unwrap(turn), int(at[0])
    asked_at, known_at = [(time - first) / _NANO for time in times], (at - first) / _NANO
    rows = np.stack([np.interp(asked_at, known_at, values) for values in (x, y, turn)], axis=1).tolist()
    return [
        (a, b, c) if known_at[0] <= t <= known_at[-1] else None for t, (a, b, c) in zip(asked_at, rows, strict=True)
    ]


def _placed(message: Any) -> Iterator[tuple[str, Planar]]:  # noqa: ANN401 - of rosbags
    """Frame that a message's poses lie in (empty of odometry), and the poses."""
    if hasattr(message, "pose"):
        yield "", _planar(message.pose.pose.position, message.pose.pose.orientation)
        return
    for one in message.transforms:
        if one.child_frame_id.strip("/").startswith("base"):
            yield one.header.frame_id.strip("/"), _planar(one.transform.translation, one.transform.rotation)


def _planar(place: Any, turn: Any) -> Planar:  # noqa: ANN401 - of rosbags
    """A heading that is not a number where the quaternion, of any length, is zero."""
    sine, cosine = 2.0 * (turn.w * turn.z + turn.x * turn.y), turn.w**2 + turn.x**2 - turn.y**2 - turn.z**2
    return (
        float(place.x),
        float(place.y),
        math.atan2(sine, cosine) if turn.w or turn.x or turn.y or turn.z else math.nan,
    )


def _encoded(message: Any, max_bytes: int) -> bytes:  # noqa: ANN401 - of rosbags
    """An image's message as the bytes of an image file: those it holds, or PNM, or PNG of 16 bits."""
    import cv2
    import numpy as np

    if hasattr(message, "format"):
        return bytes(message.data)
    channels, deep = _LAYOUTS.get(message.encoding, 0), message.encoding.endswith(("16", "16UC1"))
    width, height = message.width, message.height
    if not channels:
        raise ImageReadError(
            "unsupported-pixels", f"the encoding {message.encoding!r} is none of {', '.join(_LAYOUTS)}"
        )
    size = width * channels * (1 + deep)
    if height * size > max_bytes:
        raise ImageReadError("too-many-bytes", f"the image has {width}x{height} pixels, the limit is {max_bytes} bytes")
    if message.step < size or len(message.data) < height * message.step or not height * size:
        raise ImageReadError("truncated", "the message holds fewer bytes than its size says; record it again")
    rows: NDArray[Any] = np.asarray(message.data, np.uint8)[: height * message.step].reshape(height, message.step)[
        :, :size
    ]
    if deep:  # PNM of 16 bits is none that is read
        pixels = np.ascontiguousarray(rows).view(">u2" if message.is_bigendian else "<u2")
        return cv2.imencode(".png", pixels.astype(np.uint16))[1].tobytes()
    if channels > 1:
        rows = rows.reshape(height, width, channels)[..., :3]
        rows = rows if message.encoding.startswith("rgb") else rows[..., ::-1]
    return b"P%d\n%d %d\n255\n" % (6 if channels > 1 else 5, width, height) + rows.tobytes()


@contextmanager
def _opened(path: str, kinds: tuple[str, ...]) -> Iterator[tuple[Any, list[Any]]]:
    """Reader of a bag, and the connections of a topic that holds messages of one of these types."""
    bag, _, topic = path.partition(MARK)
    require("rosbags", f"{printable(bag)}: a bag needs rosbags", "ros")
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    try:
        with AnyReader([Path(bag)], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            found = [one for one in reader.connections if one.topic == f"/{topic}" and one.msgtype in kinds]
            if not found:
                there = {one.topic: one.msgtype for one in reader.connections if one.msgtype in kinds}
                listed = ", ".join(printable(name) for name in there) or "none of this kind"
                raise UsageError(
                    f"{printable(bag)} has no topic /{printable(topic)} of {' or '.join(kinds)}; it has {listed}"
                )
            yield reader, found
    except FfsegError:
        raise
    except Exception as error:  # a MemoryError of a size that the bag claims among them
        what = f"{printable(bag)} cannot be read as a bag ({said(error)})"
        raise UsageError(f"{what}; name a .bag file or a bag's folder") from error


def map_bag(
    levels: Image, cell: float, origin: tuple[float, float], scans: Sequence[tuple[int, Mapping[str, Any]]]
) -> bytes:
    """An MCAP file with a ``nav_msgs/OccupancyGrid`` on ``/map`` and a ``sensor_msgs/LaserScan`` for each image on ``/scan``.

    Parameters
    ----------
    levels : ndarray of uint8, shape (rows, columns)
        As of ``map.pgm``: the row of greatest y first; 254 free, 0 occupied, 128 unknown.
    cell, origin
        Metres.
    scans : sequence of (int, mapping)
        Nanoseconds and `Scan.document` of each image.
    """
    import tempfile

    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store, last = get_typestore(Stores.ROS2_HUMBLE), max((time for time, _ in scans), default=0)
    in_order = sorted(scans, key=lambda one: one[0])
    messages = [("/scan", time, _scan(store.types, time, scan)) for time, scan in in_order]
    messages.append(("/map", last, _grid(store.types, last, levels, cell, origin)))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map"
        with Writer(path, version=8, storage_plugin=StoragePlugin.MCAP) as writer:
            topics = {name: writer.add_connection(name, kind, typestore=store) for name, kind in _WRITTEN.items()}
            for name, time, message in messages:
                writer.write(topics[name], time, store.serialize_cdr(message, _WRITTEN[name]))
        return next(path.glob("*.mcap")).read_bytes()


def _scan(types: Any, time: int, scan: Mapping[str, Any]) -> Any:  # noqa: ANN401 - of rosbags
    import numpy as np

    ranges = np.array([math.inf if one is None else one for one in scan["ranges"]], np.float32)
    numbers = {name: scan[name] for name in ("angle_min", "angle_max", "angle_increment", "range_min", "range_max")}
    return types[_WRITTEN["/scan"]](
        header=_header(types, time, "base_link"), **numbers, time_increment=0.0, scan_time=0.0, ranges=ranges,
        intensities=np.zeros(0, np.float32),
    )  # fmt: skip


def _grid(types: Any, time: int, levels: Image, cell: float, origin: tuple[float, float]) -> Any:  # noqa: ANN401
    import numpy as np

    place = types["geometry_msgs/msg/Pose"](
        position=types["geometry_msgs/msg/Point"](x=origin[0], y=origin[1], z=0.0),
        orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
    )
    header, (height, width) = _header(types, time, "map"), levels.shape
    info = types["nav_msgs/msg/MapMetaData"](
        map_load_time=header.stamp, resolution=cell, width=width, height=height, origin=place
    )
    occupancy = np.select([levels == 0, levels == 254], [100, 0], -1).astype(np.int8)[::-1].ravel()
    return types[_WRITTEN["/map"]](header=header, info=info, data=occupancy)


def _header(types: Any, time: int, frame: str) -> Any:  # noqa: ANN401 - of rosbags
    stamp = types["builtin_interfaces/msg/Time"](sec=time // _NANO, nanosec=time % _NANO)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)
