"""A job that is killed in any phase leaves no process, and the same command resumes to the same film.

The long run of it is `python tests/faults/kills.py --kills 200`.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from kill_at import PHASES
from kills import TARGETS, Outcome, count, kill_again_and_again

NUM_KILLS = 8  # two in each phase


def test_kills_in_every_phase(tmp_path: Path) -> None:
    """Kills at events always come in time; after a delay the run may have ended."""

    def half(seed: int) -> list[Outcome]:  # by one process, and by two workers
        folder = tmp_path / str(seed)
        folder.mkdir()
        return list(kill_again_and_again(NUM_KILLS // 2, folder, ("--workers", str(seed)), seed))

    with ThreadPoolExecutor(2) as lanes:
        outcomes = [outcome for outcomes in lanes.map(half, (1, 2)) for outcome in outcomes]
    problems = [(outcome.kill.plan, outcome.problems) for outcome in outcomes if outcome.problems]
    assert problems == []
    hits = count(outcomes)
    assert all(sum(hits[phase, target] for target in TARGETS) >= 1 for phase in PHASES), hits
    aimed = [outcome for outcome in outcomes if "event" in outcome.kill.plan]
    assert all(outcome.was_killed for outcome in aimed)
