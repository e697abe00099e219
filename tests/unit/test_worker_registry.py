"""Only workers with the same hsplat, and the same sources, may draw."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from hsplat_cli.executors import WorkerRegistry, describe_worker
from hsplat_cli.terminal import Reporter
from renderer.errors import RenderError
from renderer.system import package_versions

HERE = package_versions()["hsplat"]
SAME = describe_worker()
ADDRESS = "--scheduler tcp://here:1"


class Client:
    """Stands in for a client whose workers, by their addresses, give these answers."""

    def __init__(self, answers: dict[str, Any]) -> None:
        self.answers = answers

    def nthreads(self) -> dict[str, int]:
        return dict.fromkeys(self.answers, 1)

    def run(self, _: Callable[[], Any], *, workers: list[str], on_error: str) -> dict[str, Any]:
        assert on_error == "return"
        return {worker: self.answers[worker] for worker in workers}

    def run_on_scheduler(self, _: Callable[[], Any]) -> None:
        pass


def registry_of(answers: dict[str, Any]) -> WorkerRegistry:
    return WorkerRegistry(Client(answers), ADDRESS, Reporter())  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("other", "reason"),
    [
        (SAME | {"hsplat": "0.0.1"}, "hsplat 0.0.1"),
        (SAME | {"sources": "0" * 32}, f"hsplat {HERE} of other sources"),
        (package_versions(), f"hsplat {HERE} of other sources"),
        ("ModuleNotFoundError: hsplat_cli", "without hsplat (ModuleNotFoundError: hsplat_cli)"),
    ],
    ids=["version", "sources", "older", "none"],
)
def test_workers_with_another_hsplat_are_refused(other: Any, reason: str) -> None:
    found = registry_of({"a": SAME, "b": other})
    found.update_workers()
    assert found.usable_workers == {"a"}
    assert found.notes == [f"workers that could not draw were not used: 1 x {reason}"]
    with pytest.raises(RenderError) as caught:
        registry_of({"b": other, "c": other}).update_workers()
    assert str(caught.value) == (
        f"{ADDRESS}: no worker of the cluster can draw this film\n"
        f"  got: 2 x {reason}\n"
        f"  expected: hsplat {HERE} of the same sources, and OpenGL, as here"
    )


def test_waiting_is_reported_once(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("hsplat_cli.executors.cluster.registry._CHECK_INTERVAL_S", 0.0)
    answers: dict[str, Any] = {}  # workers come, and go again
    waits = "waiting 60 s for one; `dask worker ADDRESS` starts one\n"
    found = registry_of(answers)
    found.update_workers()
    assert capsys.readouterr() == ("", f"the cluster has no workers: {waits}")
    found.update_workers()
    answers["a"] = SAME
    found.update_workers()
    assert capsys.readouterr() == ("", "")
    del answers["a"]
    found.update_workers()
    assert capsys.readouterr() == ("", f"the cluster has no workers left: {waits}")
    quiet = WorkerRegistry(Client({}), ADDRESS, Reporter(is_quiet=True))  # type: ignore[arg-type]
    quiet.update_workers()
    assert capsys.readouterr() == ("", "")


def test_a_worker_in_doubt_is_checked_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hsplat_cli.executors.cluster.registry._CHECK_INTERVAL_S", 3600.0)
    found = registry_of({"a": SAME, "b": SAME})
    found.update_workers()
    found.recheck("a")
    assert found.usable_workers == {"b"}
    found.update_workers()
    assert found.usable_workers == {"a", "b"}
    assert found.notes == []


def test_an_excluded_worker_is_not_used_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hsplat_cli.executors.cluster.registry._CHECK_INTERVAL_S", 0.0)
    found = registry_of({"a": SAME, "b": SAME})
    found.update_workers()
    found.exclude("a", "it failed")
    found.update_workers()
    assert found.usable_workers == {"b"}
    assert found.notes == ["workers that could not draw were not used: 1 x it failed"]
