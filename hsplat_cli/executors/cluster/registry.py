"""Keeps track of the workers of a cluster, which come and go, and may have another version of hsplat or none."""

from __future__ import annotations

import re
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from hsplat_cli.executors.cluster.worker import describe_worker
from hsplat_cli.terminal import Reporter
from renderer.errors import RenderError

if TYPE_CHECKING:
    from distributed import Client

T = TypeVar("T")

# Seconds between two looks for workers.
_CHECK_INTERVAL_S = 1.0
# Longest time without any worker before the film fails, in seconds.
_MAX_WAIT_S = 60.0
_HINT = "`dask worker ADDRESS` starts one"


class WorkerRegistry:
    """Keeps track of the workers of a cluster: which can draw, are busy, or are excluded.

    where: the option that chose the cluster, for messages. usable_workers: the addresses of the workers that can draw.
    """

    def __init__(self, client: Client, where: str, reporter: Reporter) -> None:
        self._client, self._reporter = client, reporter
        self._error = partial(RenderError, where=where)
        self._here = describe_worker()
        self._excluded: dict[str, str] = {}  # the reason for each excluded worker, by its address
        self._missing_text, self._is_reported = "the cluster has no workers", False
        self._next_check = self._last_seen = time.monotonic()
        self.usable_workers: set[str] = set()
        self._busy: set[str] = set()
        self._changed, self._is_closed = threading.Condition(), False
        self._require_hsplat_in_scheduler()

    def num_beside(self, worker: str) -> int:
        """Return the number of workers on the machine of this worker, which counts, too."""
        host, _, _ = worker.rpartition(":")
        return sum(each.rpartition(":")[0] == host for each in [*self.usable_workers])

    @contextmanager
    def idle_worker(self) -> Iterator[str]:
        """Wait for an idle worker, and keep it busy in this context. Raises CancelledError after `close`."""
        with self._changed:
            while not (idle := self.usable_workers - self._busy):
                if self._is_closed:
                    raise CancelledError
                self._changed.wait()
            worker = min(idle)
            self._busy.add(worker)
        try:
            yield worker
        finally:
            with self._changed:
                self._busy.remove(worker)
                self._changed.notify()

    def close(self) -> None:
        """Make every thread that waits for a worker raise CancelledError."""
        with self._changed:
            self._is_closed = True
            self.usable_workers.clear()
            self._changed.notify_all()

    def exclude(self, worker: str, why: str) -> None:
        """Do not use this worker again. why: the reason, for notes and messages."""
        self._excluded[worker] = why
        self.usable_workers.discard(worker)

    def recheck(self, worker: str) -> None:
        """Stop using a worker that may be gone, and let the next update, which is due at once, check it."""
        self.usable_workers.discard(worker)
        self._next_check = time.monotonic()

    def update_workers(self) -> int:
        """Ask the scheduler for its workers if a look is due, and return the number of workers that can draw.

        Raises RenderError where no worker can draw, or there has been no worker for too long.
        """
        now = time.monotonic()
        if now < self._next_check:
            return len(self.usable_workers)
        present = set(self._ask(self._client.nthreads))
        self._next_check = now + _CHECK_INTERVAL_S
        self.usable_workers &= present
        if new := present - self.usable_workers - self._excluded.keys():
            self._check_new_workers(new)
            with self._changed:
                self._changed.notify_all()
        if present:
            self._missing_text, self._is_reported = "the cluster has no workers left", False
            self._last_seen = time.monotonic()
        elif now > self._last_seen + _MAX_WAIT_S:
            raise self._error(self._missing_text, got=f"none for {_MAX_WAIT_S:g} s", hint=_HINT)
        elif not self._is_reported:
            self._is_reported = True
            self._reporter.status(f"{self._missing_text}: waiting {_MAX_WAIT_S:g} s for one; {_HINT}")
        if present and present <= self._excluded.keys():
            raise self._error(
                "no worker of the cluster can draw this film",
                got=_count_reasons(self._excluded[worker] for worker in present),
                expected=f"hsplat {self._here['hsplat']} of the same sources, and OpenGL, as here",
            )
        return len(self.usable_workers)

    @property
    def notes(self) -> list[str]:
        """Return a note for the user on workers that were not used."""
        excluded = _count_reasons(self._excluded.values())
        return [f"workers that could not draw were not used: {excluded}"] if excluded else []

    def _check_new_workers(self, workers: set[str]) -> None:
        # The function runs directly and not as a task: a worker that lacks the module of a task's function would end.
        answers = self._ask(lambda: self._client.run(describe_worker, workers=sorted(workers), on_error="return"))
        for worker, answer in answers.items():
            if not isinstance(answer, dict):
                # Dask sends some exceptions as text.
                if isinstance(answer, ImportError) or re.search("ModuleNotFoundError|ImportError", str(answer)):
                    self._excluded[worker] = f"without hsplat ({answer})"
                elif not isinstance(answer, OSError):  # an OSError means that the worker is gone again
                    self._excluded[worker] = str(answer)
            elif answer["hsplat"] != self._here["hsplat"]:
                self._excluded[worker] = f"hsplat {answer['hsplat']}"
            elif answer.get("sources") != self._here["sources"]:  # a changed checkout still has its release's version
                self._excluded[worker] = f"hsplat {answer['hsplat']} of other sources"
            else:
                self.usable_workers.add(worker)

    def _require_hsplat_in_scheduler(self) -> None:
        try:
            self._ask(lambda: self._client.run_on_scheduler(describe_worker))
        except ImportError as error:
            raise self._error(
                "the scheduler needs hsplat, too, to pass tasks on to workers",
                got=str(error),
                hint=f"install hsplat {self._here['hsplat']} in its environment",
            ) from error

    def _ask(self, question: Callable[[], T]) -> T:
        """Return the scheduler's answer to a call. Raises RenderError where the scheduler no longer answers."""
        try:
            return question()
        except OSError as error:  # Dask's own errors included
            raise self._error("the scheduler no longer answers") from error


def _count_reasons(reasons: Iterable[str]) -> str:
    """Return the reasons with their numbers, in one line: `2 x hsplat 0.1.0; 1 x without hsplat`."""
    lines = (" ".join(why.split()) for why in reasons)
    return "; ".join(f"{num} x {why}" for why, num in sorted(Counter(lines).items()))
