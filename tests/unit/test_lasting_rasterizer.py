"""A context that is lost while this process draws is replaced, and the film stays the same."""

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
from film_stages import PLAIN, SCENES, stage_of
from small_scene import small_scene

from hsplat_cli import main
from hsplat_cli.executors import draw_locally, executor
from renderer.draw import GLRasterizer, RecoveringRasterizer
from renderer.errors import ContextLostError, RenderError
from renderer.frame import BudgetController, LODCostEstimator, Stage, calibrate_costs
from renderer.scene import with_tolerances

NO_CAPABILITY = 0xFFFF
LOST_ONCE = ["OpenGL's context was lost once, and what it had was drawn again"]


class _Failing(GLRasterizer):
    """A rasteriser with errors in GL. fails: whether there is one after the next picture."""

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
    """Return a function that makes rasterisers, which fail at these pictures, counted over all of them."""
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
    return [drawn.picture.png for drawn in draw_locally(stage, range(8), rasterizer)]


@pytest.mark.parametrize("kind", ["gaussian", "overlay"])
def test_the_film_is_the_same(rasterizer: GLRasterizer, kind: str) -> None:
    """Frames whose context was lost are drawn again, to the same bytes."""
    stage = stage_of(SCENES[kind])
    with RecoveringRasterizer(failing_at({0, 4})) as lasting:
        assert pngs(stage, lasting) == pngs(stage, rasterizer)
        assert lasting.notes == ["OpenGL's context was lost 2 times, and what it had was drawn again"]


@pytest.mark.parametrize(("step", "refused"), [("texture3d", 0), ("texture", 1), ("framebuffer", 1), ("buffer", 2)])
def test_bricks_are_uploaded_again(monkeypatch: pytest.MonkeyPatch, step: str, refused: int) -> None:
    """Atlas, table, target and vertices are lost with their context, wherever the loss is noticed."""
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


def test_a_frame_that_loses_it_again_is_an_error(stage: Stage, rasterizer: GLRasterizer) -> None:
    with (
        RecoveringRasterizer(failing_at({3, 4})) as lasting,
        pytest.raises(ContextLostError, match="its context was lost\n  got: GL_INVALID_ENUM"),
    ):
        pngs(stage, lasting)


def test_frames_on_a_budget_of_time(stage: Stage, rasterizer: GLRasterizer) -> None:
    """A frame at a tolerance is the same as without a loss. Trial drawings may lose their context, too."""
    with RecoveringRasterizer(failing_at({0, 6, 9})) as lasting:
        estimator = LODCostEstimator(stage)
        calibrate_costs(estimator, 0, 0.0, lasting, clock=time.perf_counter)
        controller = BudgetController(estimator, lambda frame: 0.01)
        found = list(draw_locally(stage, range(8), lasting, controller))
        assert lasting.notes == ["OpenGL's context was lost 3 times, and what it had was drawn again"]
    tolerances = {drawn.number: drawn.record["tolerance"] for drawn in found}
    assert list(tolerances) == list(range(8))
    assert [drawn.picture.png for drawn in found] == pngs(
        replace(stage, scene=with_tolerances(stage.scene, tolerances)), rasterizer
    )


def test_another_device_is_none(stage: Stage) -> None:
    """A context of another device is refused, because its pictures would be other bytes."""

    def make_another() -> GLRasterizer:
        other = GLRasterizer()
        other.renderer_name = "another one"
        return other

    with RecoveringRasterizer(run_sequentially(failing_at({2}), make_another)) as lasting:
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
    monkeypatch.setattr(executor, "open_rasterizer", lambda **_: make())
    assert main.run(["render", "scene.yaml", "--workers", "1", "--output", "lost.mp4"]) == 0
    assert f"note: {LOST_ONCE[0]}\n" in capsys.readouterr().out
    assert Path("lost.mp4").read_bytes() == Path("whole.mp4").read_bytes()
