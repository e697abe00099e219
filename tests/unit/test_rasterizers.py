"""How many threads draw."""

from __future__ import annotations

import pytest

from renderer.cores import num_cores, num_drawing_threads


@pytest.mark.parametrize(("wanted", "expected"), [("3", 3), ("0", 1), ("1", 1)])
def test_as_many_as_mesa_would_take(monkeypatch: pytest.MonkeyPatch, wanted: str, expected: int) -> None:
    monkeypatch.setenv("LP_NUM_THREADS", wanted)
    assert num_drawing_threads() == expected


@pytest.mark.parametrize("wanted", ["", "-1", "many", "1e9", "99999999999", "\N{SUPERSCRIPT TWO}"])
def test_what_is_no_number_of_threads_is_passed_over(monkeypatch: pytest.MonkeyPatch, wanted: str) -> None:
    monkeypatch.setenv("LP_NUM_THREADS", wanted)
    assert num_drawing_threads() == num_cores()


def test_one_for_each_core(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("LP_NUM_THREADS", raising=False)
    assert num_drawing_threads() == num_cores()
