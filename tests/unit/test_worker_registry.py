"""Which workers of a cluster may draw: those with this hsplat, to the last byte of what draws."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from hsplat_cli.executors.cluster import registry
from hsplat_cli.executors.cluster.registry import WorkerRegistry
from hsplat_cli.executors.cluster.worker import describe_worker
from hsplat_cli.terminal import Reporter
from renderer.errors import RenderError
from renderer.versions import package_versions, sources_digest

HERE = package_versions()["hsplat"]
SAME = describe_worker()
ADDRESS = "tcp://here:1"


class Client:
    """Of a scheduler whose workers answer so, by their addresses."""

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
    return WorkerRegistry(Client(answers), ADDRESS, 30.0, Reporter())  # type: ignore[arg-type]


def test_what_a_worker_tells() -> None:
    assert package_versions() | {"sources": sources_digest()} == SAME


@pytest.mark.parametrize(
    ("other", "told"),
    [
        (SAME | {"hsplat": "0.0.1"}, "hsplat 0.0.1"),
        (SAME | {"sources": "0" * 32}, f"hsplat {HERE} of other sources"),
        (package_versions(), f"hsplat {HERE} of other sources"),  # one that does not tell them yet
        ("ModuleNotFoundError: hsplat_cli", "without hsplat (ModuleNotFoundError: hsplat_cli)"),
    ],
    ids=["version", "sources", "older", "none"],
)
def test_workers_with_another_hsplat_are_refused(other: Any, told: str) -> None:
    found = registry_of({"a": SAME, "b": other})
    found.update_workers()
    assert found.usable_workers == {"a"}
    assert found.notes == [f"workers that could not draw were not used: 1 x {told}"]
    with pytest.raises(RenderError) as caught:
        registry_of({"b": other, "c": other}).update_workers()
    assert str(caught.value) == (
        f"--scheduler {ADDRESS}: no worker of the cluster can draw this film\n"
        f"  got: 2 x {told}\n"
        f"  expected: hsplat {HERE} of the same sources, and OpenGL, as here"
    )


def test_that_it_waits_is_said_at_once(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Once, and again when workers have come and gone."""
    monkeypatch.setattr(registry, "_CHECK_INTERVAL_S", 0.0)
    answers: dict[str, Any] = {}
    waits = "waiting 30 s for one; `dask worker ADDRESS` starts one\n"
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
    quiet = WorkerRegistry(Client({}), ADDRESS, 30.0, Reporter(is_quiet=True))  # type: ignore[arg-type]
    quiet.update_workers()
    assert capsys.readouterr() == ("", "")


def test_who_is_in_doubt_is_looked_at_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """At once, whenever all were to be looked at."""
    monkeypatch.setattr(registry, "_CHECK_INTERVAL_S", 3600.0)
    found = registry_of({"a": SAME, "b": SAME})
    found.update_workers()
    found.recheck("a")
    assert found.usable_workers == {"b"}
    found.update_workers()
    assert found.usable_workers == {"a", "b"}
    assert found.notes == []
