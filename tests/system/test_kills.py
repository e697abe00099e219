"""A job that is killed in whatever phase leaves nothing that runs, and the same command goes on to the same film.

The long run of it is `python tests/faults/kills.py --kills 200`.
"""

from __future__ import annotations

from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from kill_at import PHASES
from kills import LEAST_EACH, MANY, TARGETS, Outcome, count, kill_again_and_again, table, too_few

NUM_KILLS = 20


def test_twenty_kills(tmp_path: Path) -> None:
    """Places in the program are hit for sure; by the clock a kill may come when all is done."""

    def half(seed: int) -> list[Outcome]:  # by one process, and by two workers
        folder = tmp_path / str(seed)
        folder.mkdir()
        return list(kill_again_and_again(NUM_KILLS // 2, folder, ("--workers", str(seed)), seed))

    with ThreadPoolExecutor(2) as lanes:
        outcomes = [outcome for outcomes in lanes.map(half, (1, 2)) for outcome in outcomes]
    problems = [(outcome.kill.plan, outcome.problems) for outcome in outcomes if outcome.problems]
    assert problems == []
    hits = count(outcomes)
    assert all(sum(hits[phase, target] for target in TARGETS) >= 2 for phase in PHASES), hits
    aimed = [outcome for outcome in outcomes if "event" in outcome.kill.plan]
    assert all(outcome.was_killed for outcome in aimed)


def test_of_many_kills_each_phase_has_its_share() -> None:
    counts = Counter({(phase, target): LEAST_EACH for phase in PHASES for target in TARGETS})
    assert too_few(MANY, counts) == []
    counts["drawing", "group"] -= 1
    del counts["finishing", "parent"]
    assert too_few(MANY, counts) == [("drawing", "group"), ("finishing", "parent")]
    assert too_few(MANY - 1, counts) == []
    assert table(counts) == [
        "| phase | parent | group |",
        "|---|---|---|",
        "| start | 20 | 20 |",
        "| drawing | 20 | 19 |",
        "| encoding | 20 | 20 |",
        "| finishing | 0 | 20 |",
    ]
