"""Assignment of images to shards by digests of their names, so that added files move no other."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass, replace

from ffseg.batch.plan.jobs import Plan
from ffseg.batch.tar.members import digest
from ffseg.errors import UsageError

MAX_SHARDS = 100_000
"""Each has a folder of its own."""
_NAME = re.compile(r"([1-9][0-9]*)-of-([1-9][0-9]*)")


@dataclass(frozen=True, slots=True)
class Shard:
    """One part of a run."""

    number: int
    """From 1."""
    count: int
    """Of all parts."""

    @property
    def name(self) -> str:
        """Of its folder below ``.ffseg/shards``."""
        return f"{self.number}-of-{self.count}"

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"


def read_shard(text: str) -> Shard:
    """Shard of a text such as ``3/8``.

    Raises
    ------
    UsageError
        If it is none: shards count from 1.
    """
    number, slash, count = text.partition("/")
    whole = number.isdecimal() and count.isdecimal() and text.isascii()
    if not slash or not whole or not 1 <= int(number) <= int(count) <= MAX_SHARDS:
        what = f"no part i/n with i from 1 to n and n up to {MAX_SHARDS}"
        raise UsageError(f"--shard {text!r} is {what}; the first of eight is 1/8")
    return Shard(int(number), int(count))


def shard_of_folder(name: str) -> Shard | None:
    """Shard whose folder has this name."""
    found = _NAME.fullmatch(name)
    return Shard(int(found[1]), int(found[2])) if found else None


def number_of(name: str, count: int) -> int:
    """Number of the shard, from 1, that an image of this relative name belongs to."""
    data = hashlib.blake2b(name.encode("utf-8", "surrogateescape"), digest_size=8).digest()
    return int.from_bytes(data, "big") % count + 1


def shard_plan(plan: Plan, shard: Shard) -> Plan:
    """The part of a plan that is a shard's; predecessors and starts are those of the whole."""
    jobs = [job for job in plan.jobs if number_of(job.source.name, shard.count) == shard.number]
    numbered = tuple(replace(job, index=index) for index, job in enumerate(jobs))
    names = digest("\0".join(sorted(job.source.name for job in plan.jobs)).encode("utf-8", "surrogateescape"))
    return replace(plan, jobs=numbered, shard=shard.name, whole=len(plan.jobs), names=names)
