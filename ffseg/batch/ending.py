"""The end of a run: the output folder is reconciled with the journal, and the tables are written."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

from ffseg import __version__
from ffseg.batch.executors.base import Options
from ffseg.batch.outputs.table import FILM_KINDS, GROUND, MAP_BAG, MAP_FILES, OUTPUTS, PARQUET, REPORT
from ffseg.batch.plan.jobs import output_folders, sweep
from ffseg.batch.record.keeper import Keeper
from ffseg.batch.record.ledger import Ledger, Stop
from ffseg.batch.record.ordered import StoppedError, packs_of, put_in_order
from ffseg.batch.record.survey import Survey, survey, tidy
from ffseg.batch.record.tables import START_COLUMNS, Tables, remove_old
from ffseg.batch.tar.members import digest
from ffseg.batch.workers.messages import Setup
from ffseg.errors import FfsegError, OutputError
from ffseg.io.files import printable, remove_files, sync_folders

_MIN_TOLD_FRAMES = 200
"""Frames whose map takes seconds, some 25 ms each: that is said."""


@dataclass(frozen=True, slots=True)
class Ending:
    """What is to be done once the work is over."""

    keeper: Keeper
    ledger: Ledger
    setup: Setup
    options: Options
    stop: Stop

    def write(self) -> None:
        """Write the tables, put packed outputs in order, fuse the map, write the page."""
        keeper, summary, plan = self.keeper, self.ledger.summary, self.keeper.plan
        if all(self.ledger.finished):
            sweep(plan, keeper.state)  # workers of other machines may have died
            summary.removed = tidy(keeper.journal, plan, keeper.settings)
        found = survey(keeper.journal, plan, keeper.settings, self.ledger.finished)
        summary.stale = found.num_stale + len(found.left)
        kept = [*self._packed(found), *self._fused(found)]
        tables = self._tables(found)
        written = tables.write(self._run_json(found), self.ledger.problem)
        for text in tables.partial():
            self.ledger.note(text)
        if self.options.report:
            self._write_report()
            written.append(REPORT)
        written += self._of_before(tables.folder, written)
        remove_old(tables.folder, keeper.tables_before, [*written, *kept])
        sync_folders([tables.folder, keeper.state, *output_folders(plan)])

    def _of_before(self, folder: str, written: Sequence[str]) -> list[str]:
        """Names of what an earlier run wrote of all images, is made only when asked for, and stays."""
        summary, out = self.ledger.summary, shlex.quote(printable(self.keeper.plan.out))
        endings = () if self.options.overwrite else (PARQUET, *FILM_KINDS.values())
        before = [*(name for name in self.keeper.tables_before if name.endswith(endings)), REPORT]
        left = [name for name in before if name not in written and os.path.exists(os.path.join(folder, name))]
        for name in left if summary.done or summary.failed else ():
            remedy = f"write it anew with: ffseg report {out}" if name == REPORT else "ask for it to have it made anew"
            self.ledger.note(f"{printable(name)} shows an earlier state; {remedy}")
        return left

    def _tables(self, found: Survey) -> Tables:
        plan = self.keeper.plan
        kinds = tuple(dict.fromkeys((*OUTPUTS, *plan.products.kinds)))
        return Tables(
            plan.out,
            self.keeper.state if plan.shard else plan.out,
            found,
            camera=self.setup.views is not None,
            asked=frozenset(self._requested()),
            parquet=self.options.parquet,
            kinds=kinds,
            films=plan.products.films,
        )

    def _requested(self) -> set[str]:
        """Columns and folders of outputs that were asked for."""
        plan = self.keeper.plan
        asked = {kind.folder for kind in plan.products.kinds if kind.merge}
        asked |= {"iou"} if plan.with_truth else set()
        return asked | ({START_COLUMNS[0]} if any(job.start for job in plan.jobs) else set())

    def _fused(self, found: Survey) -> Sequence[str]:
        """Write the map of all frames; names of its files."""
        views, plan = self.setup.views, self.keeper.plan
        if views is None or plan.shard or self.stop.signal or GROUND.folder not in found.with_outputs:
            return (*MAP_FILES, MAP_BAG) if self.stop.signal else ()
        from ffseg.batch.drive import drive_of

        if found.count >= _MIN_TOLD_FRAMES:
            self.ledger.note(f"{found.count} frames are being fused into map/")
        drive = drive_of(found.records(), plan.out, views)
        self.ledger.summary.drive = drive.figures()
        try:
            return drive.write(plan.out)
        except OutputError as error:
            self.ledger.problem(str(error))
        return (*MAP_FILES, MAP_BAG)

    def _packed(self, found: Survey) -> list[str]:
        """Put packed outputs in order once all are there; names of the tar files that stay in the output folder."""
        keeper, plan = self.keeper, self.keeper.plan
        kept = [*(name for name in keeper.tables_before if name.endswith(".tar")), *plan.tars]
        if plan.shard or not all(self.ledger.finished):
            return kept
        if not plan.tars:
            remove_files(packs_of(keeper.state))
            return []
        try:
            return put_in_order(plan.out, keeper.journal, found, keeper.header, lambda: bool(self.stop.signal))
        except OutputError as error:
            self.ledger.problem(str(error))
        except StoppedError:
            self.ledger.summary.signal = self.stop.signal
        return kept

    def _write_report(self) -> None:
        from ffseg.batch.report.write import write_report

        try:
            write_report(self.keeper.plan.out)
        except FfsegError as error:  # the images are done all the same
            self.ledger.problem(str(error))

    def _run_json(self, found: Survey) -> dict[str, Any]:
        summary, plan = self.ledger.summary, self.keeper.plan
        stale = [{"image": printable(name), "reason": reason} for name, reason in found.stale]
        left = [{"output": printable(path), "reason": "not what was written"} for path in found.left]
        return {
            "ffseg": __version__,
            "status": "interrupted" if summary.signal else "finished",
            "started": self.ledger.started.isoformat(timespec="seconds"),
            "ended": datetime.now(UTC).isoformat(timespec="seconds"),
            "seconds": round(summary.seconds, 3),
            "counts": summary.counts(),
            "inputs": list(plan.inputs),
            "parameters": asdict(self.setup.params),
            "versions": dict(self.ledger.versions),
            "problems": summary.problems,
            "stale": [*stale, *left],
            **({"map": summary.drive} if summary.drive else {}),
            **(self._of_shard() if plan.shard else {}),
        }

    def _of_shard(self) -> dict[str, Any]:
        """What a merge has to know."""
        plan, views = self.keeper.plan, self.setup.views
        return {
            "shard": plan.shard,
            "whole": plan.whole,
            "names": plan.names,
            "asked": sorted(self._requested()),
            "motion": digest(views.motion_text().encode()) if views else "",
        }
