"""Model files with bytes changed, cut, repeated and sealed again: read or refused with a sentence, never anything else.

``python -m tests.campaigns.fuzz_models --cases 20000 [--seed 0]``
"""

import hashlib
import sys
from collections import Counter

import numpy as np

from ffseg.evidence.features import KNOWN, NAMES
from ffseg.evidence.forest import Forest, Model, from_bytes, to_bytes
from tests.campaigns import harness

DIGEST = 32
"""Bytes of the digest at the end."""


def sample() -> bytes:
    """A model of two forests of three trees."""
    arrays = {
        "feature": np.array([3, 7, 1, 0], np.int32),
        "threshold": np.array([0.5, -1, 2, 8], np.float32),
        "left": np.array([1, -1, -4, -6], np.int32),
        "right": np.array([-2, -3, -5, -7], np.int32),
        "root": np.array([0, 2, 3], np.int32),
        "value": np.linspace(-1, 1, 7).astype(np.float32),
    }
    return to_bytes(Model(Forest(arrays), Forest(arrays, NAMES[:9]), about={"masks": 3}, exposed=True, prior=0.5))


def spoiled(data: bytes, rng: np.random.Generator) -> bytes:
    """The file with something changed; mostly sealed again, so that what lies behind the digest is reached."""
    body = bytearray(data[:-DIGEST])
    for _ in range(int(rng.integers(1, 5))):
        at, kind = int(rng.integers(0, max(1, len(body)))), int(rng.integers(0, 5))
        if kind == 0:
            body[at : at + 1] = rng.bytes(1)
        elif kind == 1:
            body[at : at + 4] = rng.choice([b"\xff\xff\xff\xff", b"\0\0\0\x80", b"\0\0\xc0\x7f", b"\0\0\0\0"])
        elif kind == 2:
            del body[at : at + int(rng.integers(1, 40))]
        elif kind == 3:
            body[at:at] = body[: int(rng.integers(1, 40))]
        else:
            body[at : at + 1] = rng.choice([b"9", b"-", b"[", b"}", b'"', b"e", b"N"])
    end = hashlib.sha256(body).digest() if rng.integers(0, 10) else data[-DIGEST:]
    return bytes(body) + end


def campaign(cases: int, seed: int = 0) -> Counter[str]:
    """How many were read, and how many refused for which reason.

    Raises
    ------
    Exception
        Whatever is neither a model nor a refusal, with the number of its case.
    """
    data, counts = sample(), Counter[str]()
    for number in range(cases):
        try:
            model = from_bytes(spoiled(data, np.random.default_rng([seed, number])))
            model.inside.probability(np.zeros((len(KNOWN), 2, 3), np.float32))
            counts["read"] += 1
        except ValueError as error:
            counts[str(error).split(",")[0][:60]] += 1
        except Exception as error:
            error.add_note(f"case {number}")
            raise
    return counts


def main(cases: int = 20_000, seed: int = 0) -> int:
    """Run the campaign and print what became of the files."""
    for reason, count in campaign(cases, seed).most_common():
        sys.stdout.write(f"{count:8} {reason}\n")
    return 0


if __name__ == "__main__":
    harness.as_command(main)
