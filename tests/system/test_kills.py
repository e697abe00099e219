"""A job that is killed in whatever phase leaves nothing that runs, and the same command goes on to the same film.

The long run of it is `python tests/faults/kills.py --kills 200`.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from kill_at import PHASES
from kills import kill_again_and_again

NUM_KILLS = 20


def test_twenty_kills(tmp_path: Path) -> None:
    """Places in the program are hit for sure; by the clock a kill may come when all is done."""
    outcomes = list(kill_again_and_again(NUM_KILLS, tmp_path, ("--workers", "2"), seed=1))
    problems = [(outcome.kill.plan, outcome.problems) for outcome in outcomes if outcome.problems]
    assert problems == []
    hits = Counter(outcome.kill.phase for outcome in outcomes if outcome.was_killed)
    assert all(hits[phase] >= 2 for phase in PHASES), hits
    aimed = [outcome for outcome in outcomes if "event" in outcome.kill.plan]
    assert all(outcome.was_killed for outcome in aimed)
