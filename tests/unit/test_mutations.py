"""The mutation campaign's own parts: how faults are put behind switches, and that its list is in order."""

from __future__ import annotations

import mutants
import mutations
from mutants import Mutant


def test_expressions_and_statements_are_switched() -> None:
    text = "if (a < b) go();\nwhile (c) { x += 2 * y; }\n"
    faults = [(1, Mutant("f", "if (a < b) go();", "")), (7, Mutant("f", "2 * y", "y"))]
    assert mutations.switched(text, faults) == (
        "if (is_on(1)) {  } else { if (a < b) go(); }\nwhile (c) { x += (is_on(7) ? (y) : (2 * y)); }\n"
    )


def test_a_fault_whose_text_has_gone_or_stands_twice_is_left_out() -> None:
    text = "x = 1; y = 1;"
    assert mutations.switched(text, [(1, Mutant("f", "z", "")), (2, Mutant("f", "= 1", "= 2"))]) == text


def test_there_are_enough_faults_and_none_twice() -> None:
    everyone = [*mutants.NATIVE, *mutants.STRUCTURAL, *mutants.MOTION]
    assert len(everyone) >= 60
    assert len({(mutant.file, mutant.old, mutant.new) for mutant in everyone}) == len(everyone)
    assert all((mutations.ROOT / "ffseg" / mutant.file).is_file() for mutant in everyone)
    assert all(mutant.old != mutant.new for mutant in everyone)


def test_the_faults_follow_the_code() -> None:
    """A change may leave a fault behind, which the campaign then says; more than a few make it say nothing."""
    everyone = [*mutants.NATIVE, *mutants.STRUCTURAL, *mutants.MOTION]
    stale = [mutant.name for mutant in everyone if mutations.is_stale(mutant)]
    assert len(stale) <= len(everyone) // 20, stale
