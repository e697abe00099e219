"""Kill a job of 30 frames at many moments in every phase, check what is left, and let the next run resume.

    python tests/faults/kills.py --kills 200

After each kill, within 5 s, no process of the job is left, no new file is in /dev/shm, and no incomplete film has the
final name. The same command, run again, makes the same frames and film as a run without a kill, byte for byte. The exit
status is 1 where that was not so.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "support"))

from commands import CODE  # noqa: E402
from kill_at import NUM_FRAMES, PHASES  # noqa: E402
from processes import MARK, marked, new_mark, wait_until  # noqa: E402

KILL_AT = Path(__file__).with_name("kill_at.py")
GRACE_S = 5.0
TARGETS = ("parent", "group", "encoder", "worker")

SCENE = f"""\
volume:
  procedural: {{name: engine_block, shape: [64, 64, 32], seed: 1}}
transfer_function:
  points:
    - {{value: 0, color: black, opacity: 0}}
    - {{value: 90, color: "#6680e6", opacity: 0.05}}
    - {{value: 255, color: "#ffe6b3", opacity: 0.6}}
camera:
  path: {{type: turntable, frames: {NUM_FRAMES}}}
output:
  file: out/film.mp4
  size: [96, 96]
"""


@dataclass(frozen=True)
class Kill:
    """A kill at an event in the program, or after a delay. plan: as in kill_at."""

    plan: dict[str, Any]

    @property
    def phase(self) -> str:
        """The phase in which to kill."""
        return str(self.plan["phase"])

    @property
    def target(self) -> str:
        """What is killed: one of TARGETS."""
        return str(self.plan["target"])


@dataclass(frozen=True)
class Outcome:
    """What a kill led to. problems: none if all is well. seconds_to_end: until the last process was gone."""

    kill: Kill
    was_killed: bool
    num_kept: int
    seconds_to_end: float
    problems: tuple[str, ...]


class Job:
    """A job in a folder of its own."""

    def __init__(self, folder: Path, options: tuple[str, ...]) -> None:
        self._folder, self._options = folder, options
        self.out = folder / "out"
        (folder / "scene.yaml").write_text(SCENE, encoding="utf-8")

    def run(self, plan: dict[str, Any]) -> tuple[int, str]:
        """Return the exit status (negative: the signal), and the mark of the processes of the run."""
        mark = new_mark()
        code_paths = os.pathsep.join([str(CODE), os.environ.get("PYTHONPATH", "")])
        environment = os.environ | {MARK: mark, "PYTHONPATH": code_paths}
        command = [sys.executable, str(KILL_AT), json.dumps(plan), str(self._folder / "report.json")]
        done = subprocess.run(
            [*command, "render", "scene.yaml", "--quiet", *self._options],
            check=False,
            cwd=self._folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,  # a group of its own, that may be killed
        )
        may_fail = plan.get("target") in ("encoder", "worker") and done.returncode == 1
        if done.returncode not in (0, -signal.SIGKILL) and not may_fail:
            raise AssertionError(done.stderr.decode())
        return done.returncode, mark

    def report(self) -> dict[str, Any]:
        """Return the report of the last run that was not killed."""
        found = json.loads((self._folder / "report.json").read_text(encoding="utf-8"))
        assert isinstance(found, dict)
        return found

    def files(self) -> dict[str, bytes]:
        """Return the files in the output's folder except the sidecar, which has times."""
        paths = (path for path in self.out.rglob("*") if path.is_file() and path.suffix != ".json")
        return {str(path.relative_to(self.out)): path.read_bytes() for path in paths}

    def clear(self) -> None:
        """Remove all output."""
        shutil.rmtree(self.out, ignore_errors=True)


def try_kill(job: Job, kill: Kill, whole: dict[str, bytes], digests: list[str]) -> Outcome:
    """Kill a run, check what is left, run again and compare. digests: of the frames of a run without a kill."""
    job.clear()
    shared = set(os.listdir("/dev/shm"))
    status, mark = job.run(kill.plan)
    was_child_killed = status == 0 and job.report()["killed"] > 0
    seconds = seconds_until_gone(mark)
    problems = [f"after {GRACE_S:g} s there are still processes {sorted(marked(mark))}"] if seconds > GRACE_S else []
    problems += [f"in /dev/shm: {name}" for name in orphans(set(os.listdir("/dev/shm")) - shared)]
    left = job.files()
    if left.get("film.mp4") not in (None, whole["film.mp4"]):
        problems.append("a film that is not whole has the final name")
    num_kept = sum(name.endswith(".png") and "partial" not in name for name in left)
    again, _ = job.run({})
    if again != 0:
        problems.append(f"the next run ended with {again}")
    elif job.files() != whole:
        problems.append(f"other files: {sorted(job.files())}")
    elif frame_digests(job) != digests:
        problems.append("other frames")
    return Outcome(kill, status != 0 or was_child_killed, num_kept, seconds, tuple(problems))


def frame_digests(job: Job) -> list[str]:
    """Return the digests of the frames in the sidecar of a complete film."""
    sidecar = json.loads((job.out / "film.mp4.json").read_text(encoding="utf-8"))
    return [frame["digest"] for frame in sidecar["frames"]]


def seconds_until_gone(mark: str) -> float:
    """Wait until no process has the mark, and return the seconds; infinity after GRACE_S."""
    start = time.monotonic()
    return time.monotonic() - start if wait_until(lambda: not marked(mark), GRACE_S) else float("inf")


def orphans(names: set[str]) -> list[str]:
    """Return the blocks of shared memory that no process has mapped; other programs may have blocks, too."""
    mapped = "".join(_maps()) if names else ""
    return sorted(name for name in names if Path("/dev/shm", name).exists() and f"/dev/shm/{name}\n" not in mapped)


def _maps() -> Iterator[str]:
    for file in Path("/proc").glob("[0-9]*/maps"):
        with suppress(OSError):  # gone meanwhile, or not ours
            yield file.read_text(errors="replace")


def make_kills(num: int, report: dict[str, Any], seed: int) -> Iterator[Kill]:
    """Yield kills of every phase and target in turn, at events and after delays in turn."""
    choose = random.Random(seed)
    for number in range(num):
        phase = number % len(PHASES)
        target = TARGETS[(number // len(PHASES) + seed) % len(TARGETS)]
        plan: dict[str, Any] = {"phase": PHASES[phase], "target": target}
        is_timing_dependent = number // (len(TARGETS) * len(PHASES)) % 2 == 1 or report["events"][phase] == 0
        if is_timing_dependent:
            plan["delay"] = choose.uniform(0, report["seconds"][phase])
        else:
            plan["event"] = choose.randint(1, report["events"][phase])
        yield Kill(plan)


def kill_again_and_again(num: int, folder: Path, options: tuple[str, ...], seed: int) -> Iterator[Outcome]:
    """Yield the outcomes of this number of kills."""
    job = Job(folder, options)
    job.run({})
    whole, digests, report = job.files(), frame_digests(job), job.report()
    assert set(whole) == {"film.mp4"}, sorted(whole)
    for kill in make_kills(num, report, seed):
        yield try_kill(job, kill, whole, digests)


def main() -> None:
    """Run the kills and print their outcomes."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", default="2")
    arguments = parser.parse_args()
    outcomes = []
    with tempfile.TemporaryDirectory() as folder:
        runs = kill_again_and_again(arguments.kills, Path(folder), ("--workers", arguments.workers), arguments.seed)
        for number, outcome in enumerate(runs, 1):
            outcomes.append(outcome)
            words = "; ".join(outcome.problems) or "ok"
            print(f"{number} {outcome.kill.plan} killed {outcome.was_killed}, {outcome.num_kept} kept, "
                  f"gone after {outcome.seconds_to_end:.2f} s: {words}", flush=True)  # fmt: skip
    counts = count(outcomes)
    bad = [outcome for outcome in outcomes if outcome.problems]
    slowest = max(outcome.seconds_to_end for outcome in outcomes)
    print("\n".join(f"{phase}, {target}: {number}" for (phase, target), number in sorted(counts.items())))
    print(f"{counts.total()} kills of {len(outcomes)} runs, {len(bad)} with problems")
    print(f"the last process of a run was gone after at most {slowest:.2f} s")
    sys.exit(bool(bad))


def count(outcomes: Sequence[Outcome]) -> Counter[tuple[str, str]]:
    """Count the runs that were killed, by phase and target; the others had ended before."""
    return Counter((outcome.kill.phase, outcome.kill.target) for outcome in outcomes if outcome.was_killed)


if __name__ == "__main__":
    main()
