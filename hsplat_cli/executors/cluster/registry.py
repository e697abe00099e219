"""Keeps track of the workers of a cluster: they come and go, and may have another hsplat, or none."""

from __future__ import annotations

import time
from collections import Counter
from typing import TYPE_CHECKING, Any

from hsplat_cli.executors.cluster.worker import describe_worker
from hsplat_cli.terminal import Reporter
from renderer.errors import RenderError

if TYPE_CHECKING:
    from distributed import Client

# Time between two looks for workers.
_CHECK_INTERVAL_S = 1.0
_HINT = "`dask worker ADDRESS` starts one"


class WorkerRegistry:
    """The workers of a cluster that can draw, as `usable_workers`, by their addresses.

    address: of the scheduler, for messages. max_wait_s: the longest time without any worker at all.
    """

    def __init__(self, client: Client, address: str, max_wait_s: float, reporter: Reporter) -> None:
        self._client, self._address, self._max_wait_s = client, address, max_wait_s
        self._here = describe_worker()
        self._excluded: dict[str, str] = {}  # why, by address
        self._had_any, self._is_reported, self._reporter = False, False, reporter
        self._next_check = self._last_seen = time.monotonic()
        self.usable_workers: set[str] = set()
        self._require_hsplat_in_scheduler()

    def exclude(self, worker: str, why: str) -> None:
        """Do not use this worker again."""
        self.usable_workers.discard(worker)
        self._excluded[worker] = why

    def recheck(self, worker: str) -> None:
        """Do not use this worker, which may be gone, until the next update has checked it, at once."""
        self.usable_workers.discard(worker)
        self._next_check = time.monotonic()

    def update_workers(self) -> None:
        """Find out which workers have come and gone, if it is time.

        Raises RenderError where none that can draw is left.
        """
        if time.monotonic() < self._next_check:
            return
        present = set(self._ask(self._client.nthreads))
        self._next_check = time.monotonic() + _CHECK_INTERVAL_S
        self.usable_workers &= present
        new = present - self.usable_workers - self._excluded.keys()
        if new:
            self._check_new_workers(new)
        if present:
            self._had_any, self._last_seen, self._is_reported = True, time.monotonic(), False
        elif time.monotonic() > self._last_seen + self._max_wait_s:
            raise RenderError(
                self._what,
                where=f"--scheduler {self._address}",
                got=f"none for {self._max_wait_s:g} s",
                hint=_HINT,
            )
        elif not self._is_reported:
            self._is_reported = True
            self._reporter.status(f"{self._what}: waiting {self._max_wait_s:g} s for one; {_HINT}")
        if present and present <= self._excluded.keys():
            raise RenderError(
                "no worker of the cluster can draw this film",
                where=f"--scheduler {self._address}",
                got=_reason_counts_text([self._excluded[worker] for worker in present]),
                expected=f"hsplat {self._here['hsplat']} of the same sources, and OpenGL, as here",
            )

    @property
    def _what(self) -> str:
        return f"the cluster has no workers{' left' if self._had_any else ''}"

    @property
    def notes(self) -> list[str]:
        """Return what the user should know."""
        if not self._excluded:
            return []
        return [f"workers that could not draw were not used: {_reason_counts_text(list(self._excluded.values()))}"]

    def _check_new_workers(self, workers: set[str]) -> None:
        # Not a task: a worker without the module of a task's function would end.
        answers = self._ask(lambda: self._client.run(describe_worker, workers=sorted(workers), on_error="return"))
        for worker, answer in answers.items():
            if isinstance(answer, dict):
                other = self._version_mismatch(answer)
                if other is None:
                    self.usable_workers.add(worker)
                else:
                    self._excluded[worker] = other
            elif _is_missing(answer):
                self._excluded[worker] = f"without hsplat ({answer})"
            elif not isinstance(answer, OSError):  # that one is gone again
                self._excluded[worker] = str(answer)

    def _version_mismatch(self, answer: dict[str, Any]) -> str | None:
        """Return the hsplat of a worker if its pictures may differ from those of the one here."""
        if answer["hsplat"] != self._here["hsplat"]:
            return f"hsplat {answer['hsplat']}"
        # A changed checkout has the version of its release.
        if answer.get("sources") != self._here["sources"]:
            return f"hsplat {answer['hsplat']} of other sources"
        return None

    def _require_hsplat_in_scheduler(self) -> None:
        try:
            self._ask(lambda: self._client.run_on_scheduler(describe_worker))
        except ImportError as error:
            raise RenderError(
                "the scheduler needs hsplat, too, to pass tasks on to workers",
                where=f"--scheduler {self._address}",
                got=str(error),
                hint=f"install hsplat {self._here['hsplat']} in its environment",
            ) from error

    def _ask(self, question: Any) -> Any:
        """Return the scheduler's answer; raises RenderError where it does not answer any more."""
        try:
            return question()
        except OSError as error:  # of Dask's, too
            raise RenderError("the scheduler no longer answers", where=f"--scheduler {self._address}") from error


def _is_missing(answer: object) -> bool:
    """Return whether a worker's answer says that a module is missing; Dask sends some exceptions as text."""
    return isinstance(answer, ImportError) or "ModuleNotFoundError" in str(answer) or "ImportError" in str(answer)


def _reason_counts_text(reasons: list[str]) -> str:
    """Return `2 x hsplat 0.1.0; 1 x without hsplat`."""
    return "; ".join(f"{num} x {why}" for why, num in sorted(Counter(reasons).items()))
