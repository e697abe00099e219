"""A context that is lost while this process draws is made anew, and nothing of that is seen in the film."""

from __future__ import annotations

import ctypes
import itertools
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import moderngl
import pytest
from film_stages import PLAIN, SCENES, SPLATS, stage_of
from small_scene import small_scene

from hsplat_cli import main
from hsplat_cli.executors import LocalExecutor, executor
from renderer.draw import GLRasterizer, RecoveringRasterizer
from renderer.errors import ContextLostError, RenderError
from renderer.frame import BudgetController, LODCostEstimator, Stage, calibrate_costs
from renderer.scene import with_tolerances

NO_CAPABILITY = 0xFFFF
LOST_ONCE = ["OpenGL's context was lost once, and what it had was drawn again"]


class _Failing(GLRasterizer):
    """fails: whether GL has an error after the next picture."""

    def __init__(self, fails: Iterator[bool]) -> None:
        self._fails: Iterator[bool] = iter(())
        super().__init__()
        self._fails = fails

    @contextmanager
    def _drawing(self) -> Iterator[None]:
        with super()._drawing():
            yield
            if next(self._fails, False):
                ctypes.CDLL("libGL.so.1").glEnable(NO_CAPABILITY)


def failing_at(pictures: Iterable[int]) -> Callable[[], GLRasterizer]:
    """Makes rasterisers that fail at these pictures, counted over all of them."""
    at = set(pictures)
    fails = (number in at for number in itertools.count())
    return lambda: _Failing(fails)


def run_sequentially(*makes: Callable[[], GLRasterizer]) -> Callable[[], GLRasterizer]:
    left = iter(makes)

    def make() -> GLRasterizer:
        return next(left)()

    return make


@pytest.fixture(scope="module")
def stage() -> Stage:
    return stage_of(PLAIN)


def pngs(stage: Stage, rasterizer: GLRasterizer | RecoveringRasterizer) -> list[bytes]:
    return [drawn.picture.png for drawn in LocalExecutor(stage, rasterizer).draw(range(8))]


@pytest.mark.parametrize("kind", ["plain", "gaussian", "overlay", "gouraud"])
def test_the_film_is_the_same(rasterizer: GLRasterizer, kind: str) -> None:
    stage = stage_of(SCENES[kind])
    with RecoveringRasterizer(failing_at({0, 4})) as lasting:
        assert pngs(stage, lasting) == pngs(stage, rasterizer)
        assert lasting.notes == ["OpenGL's context was lost 2 times, and what it had was drawn again"]


def test_a_context_that_refuses_is_lost(rasterizer: GLRasterizer, monkeypatch: pytest.MonkeyPatch) -> None:
    """A lost one may be noticed in the midst of a picture, where something is to be made."""
    stage = stage_of(SPLATS)
    whole_buffer = moderngl.Context.buffer
    calls = itertools.count()

    def buffer(self: moderngl.Context, *arguments: Any, **options: Any) -> moderngl.Buffer:
        if next(calls) == 4:
            raise moderngl.Error("cannot create buffer")
        return whole_buffer(self, *arguments, **options)

    expected = pngs(stage, rasterizer)
    with RecoveringRasterizer() as lasting:
        monkeypatch.setattr(moderngl.Context, "buffer", buffer)
        assert pngs(stage, lasting) == expected
        assert lasting.notes == LOST_ONCE


@pytest.mark.parametrize(("step", "refused"), [("texture3d", 0), ("texture", 1), ("framebuffer", 1), ("buffer", 2)])
def test_bricks_are_uploaded_again(monkeypatch: pytest.MonkeyPatch, step: str, refused: int) -> None:
    """Atlas, table, target and boxes go with their context, whichever is to be made when it is found lost."""
    stage = stage_of(PLAIN)
    on_device = partial(GLRasterizer, brick_backend="device")
    with on_device() as gl:
        expected = pngs(stage, gl)
    whole_step = getattr(moderngl.Context, step)
    calls = itertools.count()

    def refusing(self: moderngl.Context, *arguments: Any, **options: Any) -> Any:
        if next(calls) == refused:
            raise moderngl.Error("cannot create it")
        return whole_step(self, *arguments, **options)

    with RecoveringRasterizer(on_device) as lasting:
        monkeypatch.setattr(moderngl.Context, step, refusing)
        assert pngs(stage, lasting) == expected
        assert next(calls) > refused + 1
        assert lasting.notes == LOST_ONCE


def test_nothing_is_said_where_nothing_is_lost(stage: Stage) -> None:
    with RecoveringRasterizer() as lasting:
        pngs(stage, lasting)
        assert lasting.notes == []


def test_a_frame_that_loses_it_again_is_an_error(stage: Stage, rasterizer: GLRasterizer) -> None:
    with (
        RecoveringRasterizer(failing_at({3, 4})) as lasting,
        pytest.raises(ContextLostError, match="its context was lost\n  got: GL_INVALID_ENUM"),
    ):
        pngs(stage, lasting)


def test_frames_on_a_budget_of_time(stage: Stage, rasterizer: GLRasterizer) -> None:
    """Those of each tolerance are what they are without a loss; trial drawings may lose their context, too."""
    with RecoveringRasterizer(failing_at({0, 6, 9})) as lasting:
        estimator = LODCostEstimator(stage)
        calibrate_costs(estimator, 0, 0.0, lasting, clock=time.perf_counter)
        controller = BudgetController(estimator, lambda frame: 0.01)
        found = list(LocalExecutor(stage, lasting, controller).draw(range(8)))
        assert lasting.notes == ["OpenGL's context was lost 3 times, and what it had was drawn again"]
    tolerances = {drawn.number: drawn.record["tolerance"] for drawn in found}
    assert list(tolerances) == list(range(8))
    assert [drawn.picture.png for drawn in found] == pngs(
        replace(stage, scene=with_tolerances(stage.scene, tolerances)), rasterizer
    )


def test_another_device_is_none(stage: Stage) -> None:
    """Its pictures would be other bytes."""

    class _Other(GLRasterizer):
        renderer_name = "another one"  # type: ignore[assignment]

    with RecoveringRasterizer(run_sequentially(failing_at({2}), _Other)) as lasting:
        with pytest.raises(ContextLostError, match="its context was lost"):
            pngs(stage, lasting)
        assert lasting.notes == []


def test_no_other_context(stage: Stage) -> None:
    def refuse() -> GLRasterizer:
        raise RenderError("no OpenGL 3.3 context could be made")

    with (
        RecoveringRasterizer(run_sequentially(failing_at({2}), refuse)) as lasting,
        pytest.raises(ContextLostError, match="its context was lost"),
    ):
        pngs(stage, lasting)


def test_the_command_goes_on_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("scene.yaml").write_text(small_scene(), encoding="utf-8")
    assert main.run(["render", "scene.yaml", "--workers", "1", "--output", "whole.mp4"]) == 0
    assert "note: OpenGL" not in capsys.readouterr().out
    make = failing_at({2})
    monkeypatch.setattr(executor, "open_recovering_rasterizer", lambda *, needs_opengl: RecoveringRasterizer(make))
    assert main.run(["render", "scene.yaml", "--workers", "1", "--output", "lost.mp4"]) == 0
    assert f"note: {LOST_ONCE[0]}\n" in capsys.readouterr().out
    assert Path("lost.mp4").read_bytes() == Path("whole.mp4").read_bytes()
