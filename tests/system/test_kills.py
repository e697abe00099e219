"""A job that is killed in any phase leaves no process, and the same command resumes to the same film.

The long run of it is `python tests/faults/kills.py --kills 200`.
"""

from __future__ import annotations

from pathlib import Path

from kill_at import PHASES
from kills import count, kill_again_and_again


def test_kills_in_every_phase(tmp_path: Path) -> None:
    """Kills, of the whole group, at events always come in time. Two workers draw the frames."""
    outcomes = list(kill_again_and_again(len(PHASES), tmp_path, ("--workers", "2"), seed=5))
    assert [(outcome.kill.plan, outcome.problems) for outcome in outcomes if outcome.problems] == []
    assert all(outcome.was_killed for outcome in outcomes if "event" in outcome.kill.plan)
    assert {phase for phase, _ in count(outcomes)} == {*PHASES}
