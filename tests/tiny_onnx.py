"""ONNX files of one convolution of 1 x 1, written by hand (protocol buffers)."""

import struct
from collections.abc import Sequence


def varint(number: int) -> bytes:
    """A number in groups of seven bits, lowest first."""
    data = bytearray()
    while number > 0x7F:
        data.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*data, number])


def number(field: int, value: int) -> bytes:
    return varint(field << 3) + varint(value)


def text(field: int, value: bytes | str) -> bytes:
    data = value.encode() if isinstance(value, str) else value
    return varint(field << 3 | 2) + varint(len(data)) + data


def tensor(name: str, shape: Sequence[int], values: Sequence[float]) -> bytes:
    dimensions = b"".join(number(1, size) for size in shape)
    return dimensions + number(2, 1) + text(8, name) + text(9, struct.pack(f"<{len(values)}f", *values))


def value(name: str, shape: Sequence[int | str]) -> bytes:
    sides = b"".join(text(1, number(1, side) if isinstance(side, int) else text(2, side)) for side in shape)
    return text(1, name) + text(2, text(1, number(1, 1) + text(2, sides)))


def node(kind: str, inputs: Sequence[str], output: str, attributes: bytes = b"") -> bytes:
    return b"".join(text(1, name) for name in inputs) + text(2, output) + text(3, output) + text(4, kind) + attributes


def pointwise(weights: Sequence[Sequence[float]], bias: Sequence[float], *, squash: bool = True) -> bytes:
    """A network whose output channels are weighed sums of red, green, blue (plus bias, squashed by a sigmoid)."""
    count = len(weights)
    flat = [weight for row in weights for weight in row]
    kernel = text(1, "kernel_shape") + number(8, 1) + number(8, 1) + number(20, 7)
    nodes = [node("Conv", ["x", "w", "b"], "sums" if squash else "out", text(5, kernel))]
    if squash:
        nodes.append(node("Sigmoid", ["sums"], "out"))
    graph = b"".join(text(1, one) for one in nodes) + text(2, "tiny")
    graph += text(5, tensor("w", (count, 3, 1, 1), flat)) + text(5, tensor("b", (count,), bias))
    graph += text(11, value("x", (1, 3, "h", "w"))) + text(12, value("out", (1, count, "h", "w")))
    return number(1, 7) + text(7, graph) + text(8, text(1, "") + number(2, 11))
