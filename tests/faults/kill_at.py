"""Run a command line of hsplat in this process, and kill it at an exact moment.

    python kill_at.py PLAN REPORT ARGUMENTS...

PLAN is JSON: {"phase": ..., "event": n} kills at the n-th event of a phase, {"phase": ..., "delay": s} so many seconds
after its beginning, {} not at all; "target" says what is killed: the process ("parent"), its process group ("group"),
the encoder's process ("encoder"), or the first process of a cluster ("worker"). Events are what
Python's audit hooks tell of: files in the output's folder that are opened, renamed or removed, processes that are
started. REPORT gets the events and the seconds of each phase of a run that was not killed.

    start      until the first frame is kept
    drawing    until all frames are kept
    encoding   until the film has its name
    finishing  until the end
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

PHASES = ("start", "drawing", "encoding", "finishing")
EVENTS = ("open", "os.rename", "os.remove", "os.rmdir", "os.mkdir", "subprocess.Popen")
NUM_FRAMES = 30
# Words of the command lines of children.
PROGRAMS = {"encoder": b"ffmpeg", "worker": b"local_worker"}


class Hook:
    """Follows the phases of a job by what it does to files."""

    def __init__(self, plan: dict[str, Any], folder: Path) -> None:
        self._plan, self._folder = plan, str(folder)
        self.num_killed = 0
        self._phase, self._num_kept, self._is_busy = 0, 0, False
        self._lock = threading.RLock()  # frames are kept by another thread than draws them
        self.events = [0] * len(PHASES)
        self.begins = [time.monotonic()]
        self._enter()

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        """An audit hook; what it does itself is not an event."""
        if event not in EVENTS:
            return
        with self._lock:
            if not self._is_busy:
                self._notice(event, arguments)

    def _notice(self, event: str, arguments: tuple[Any, ...]) -> None:
        paths = [os.fsdecode(item) for item in arguments[:2] if isinstance(item, (str, bytes, os.PathLike))]
        if event != "subprocess.Popen" and not any(self._folder in os.path.abspath(path) for path in paths):
            return
        self._is_busy = True
        self._see(event, paths)
        self._is_busy = False

    def _see(self, event: str, paths: list[str]) -> None:
        self.events[self._phase] += 1
        plan = self._plan
        if plan.get("phase") == PHASES[self._phase] and plan.get("event") == self.events[self._phase]:
            self.kill()
        renamed = paths[-1] if event == "os.rename" else ""
        # The event comes before the deed: a frame is kept when the next event is seen, near enough.
        if renamed.endswith(".png"):
            self._num_kept += 1
            if self._num_kept in (1, NUM_FRAMES):
                self._next()
        if renamed.endswith(".mp4"):
            self._next()

    def _next(self) -> None:
        self._phase += 1
        self.begins.append(time.monotonic())
        self._enter()

    def _enter(self) -> None:
        if self._plan.get("phase") == PHASES[self._phase] and "delay" in self._plan:
            timer = threading.Timer(self._plan["delay"], self.kill)
            timer.daemon = True
            timer.start()

    def kill(self) -> None:
        """End the target, as nothing can prevent; nothing where a child is not there, yet or any more."""
        target = self._plan["target"]
        if target == "group":
            os.killpg(0, signal.SIGKILL)
        elif target == "parent":
            os.kill(os.getpid(), signal.SIGKILL)
        else:
            for child in children_with(PROGRAMS[target])[:1]:
                os.kill(child, signal.SIGKILL)
                self.num_killed += 1


def children_with(word: bytes) -> list[int]:
    """Return the children of this process whose command line has this word."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # gone meanwhile
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            if parent == os.getpid() and word in (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
    return found


def main() -> None:
    """Run the command line that comes after the plan and the report."""
    plan, report, *arguments = sys.argv[1:]
    hook = Hook(json.loads(plan), Path(report).parent / "out")
    sys.addaudithook(hook)
    from hsplat_cli.main import run

    code = run(arguments)
    ends = [*hook.begins[1:], time.monotonic()]
    seconds = [end - begin for begin, end in zip(hook.begins, ends, strict=True)]
    Path(report).write_text(
        json.dumps({"events": hook.events, "seconds": seconds, "killed": hook.num_killed}), encoding="utf-8"
    )
    sys.exit(code)


if __name__ == "__main__":
    main()
