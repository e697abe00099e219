"""A context that is lost is an error by name, or is replaced, and the film stays the same."""

from __future__ import annotations

import ctypes
import itertools
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest
from film_stages import SCENES, stage_of
from small_scene import small_scene
from splatting import in_order, look, place_splats

from hsplat_cli import main
from renderer.draw import RecoveringRasterizer, SplatRasterizer, open_rasterizer
from renderer.errors import ContextLostError, InputError, RenderError
from renderer.frame import ScheduleController, Stage
from renderer.job import draw_frames
from renderer.volume import Float32

NO_CAPABILITY = 0xFFFF
LOST_ONCE = ["OpenGL's context was lost once, and the unfinished pictures were drawn again"]


class _Failing(SplatRasterizer):
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


def failing_at(pictures: Iterable[int]) -> Callable[[], SplatRasterizer]:
    """Return a function that makes rasterisers, which fail at these pictures, counted over all of them."""
    at = set(pictures)
    fails = (number in at for number in itertools.count())
    return lambda: _Failing(fails)


def run_sequentially(*makes: Callable[[], SplatRasterizer]) -> Callable[[], SplatRasterizer]:
    left = iter(makes)

    def make() -> SplatRasterizer:
        return next(left)()

    return make


@pytest.fixture(scope="module")
def stage() -> Stage:
    return stage_of(SCENES["gaussian"])


def pngs(stage: Stage, rasterizer: SplatRasterizer | RecoveringRasterizer) -> list[bytes]:
    return [drawn.pictures[0].content for drawn in draw_frames(stage, range(8), rasterizer, ScheduleController(stage))]


def test_the_film_is_the_same(stage: Stage, rasterizer: SplatRasterizer) -> None:
    """Frames whose context was lost are drawn again, to the same bytes."""
    with RecoveringRasterizer(failing_at({0, 4})) as recovering:
        assert pngs(stage, recovering) == pngs(stage, rasterizer)
        assert recovering.notes == ["OpenGL's context was lost 2 times, and the unfinished pictures were drawn again"]


def test_a_frame_that_loses_it_again_is_an_error(stage: Stage, rasterizer: SplatRasterizer) -> None:
    with (
        RecoveringRasterizer(failing_at({3, 4})) as recovering,
        pytest.raises(ContextLostError, match="its context was lost\n  got: GL_INVALID_ENUM"),
    ):
        pngs(stage, recovering)


def another_device() -> SplatRasterizer:
    other = SplatRasterizer()
    other.device = "another one"
    return other


def no_context() -> SplatRasterizer:
    raise RenderError("no OpenGL 3.3 context could be made")


@pytest.mark.parametrize("make_second", [another_device, no_context])
def test_only_a_context_of_the_same_device_replaces_a_lost_one(
    stage: Stage, make_second: Callable[[], SplatRasterizer]
) -> None:
    """Pictures of another device would be other bytes."""
    with RecoveringRasterizer(run_sequentially(failing_at({2}), make_second)) as recovering:
        for _ in range(2):  # nor later, where a caller goes on
            with pytest.raises(ContextLostError, match="its context was lost\n  got: GL_INVALID_ENUM"):
                pngs(stage, recovering)
        assert recovering.notes == []


def test_the_command_continues_and_prints_a_note(folder, monkeypatch, capsys) -> None:
    Path("scene.yaml").write_text(small_scene(footprint="gaussian"), encoding="utf-8")
    assert main.run(["render", "scene.yaml", "--output", "whole.mp4"]) == 0
    assert "note: OpenGL" not in capsys.readouterr().out
    make = failing_at({2})
    monkeypatch.setattr("renderer.job.executor.open_rasterizer", lambda *_: RecoveringRasterizer(make))
    assert main.run(["render", "scene.yaml", "--output", "lost.mp4"]) == 0
    assert f"note: {LOST_ONCE[0]}\n" in capsys.readouterr().out
    assert Path("lost.mp4").read_bytes() == Path("whole.mp4").read_bytes()


# Errors that are raised


def test_an_error_of_gl_is_raised() -> None:
    with SplatRasterizer() as gl:
        draw_splats(gl)
        with gl._context:
            ctypes.CDLL("libGL.so.1").glEnable(NO_CAPABILITY)
        with pytest.raises(ContextLostError) as raised:
            draw_splats(gl)
        assert str(raised.value) == (
            f"{gl.device}: OpenGL failed to draw, or its context was lost\n  got: GL_INVALID_ENUM"
        )


def refuse(*arguments: Any, **options: Any) -> None:
    raise moderngl.Error("cannot create it")


def draw_splats(gl: SplatRasterizer | RecoveringRasterizer) -> Float32:
    splats = place_splats(np.zeros((1, 3)), 0.1)
    return gl.rasterize([splats], [in_order(splats)], look())


@pytest.mark.parametrize("step", ["buffer", "program", "vertex_array", "framebuffer"])
def test_what_gl_refuses_is_a_lost_context(step: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A lost context is reported by name, although it answers no query any more."""
    with SplatRasterizer() as gl:
        name = gl.device
        monkeypatch.setattr(moderngl.Context, step, refuse)
        monkeypatch.setattr(moderngl.Context, "info", {})
        with pytest.raises(ContextLostError) as raised:
            draw_splats(gl)
    assert str(raised.value) == f"{name}: OpenGL failed to draw, or its context was lost\n  got: cannot create it"


def refusal() -> str:
    """Return the error of a device that is not tried a second time: another context would refuse it, too."""
    with RecoveringRasterizer(run_sequentially(SplatRasterizer)) as recovering:
        with pytest.raises(RenderError) as raised:
            draw_splats(recovering)
        assert not isinstance(raised.value, ContextLostError)
        assert recovering.notes == []
        return str(raised.value).replace(recovering.device, "device")


def refuse_pictures(step: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a device refuse pictures, as one without memory does."""
    whole_step = getattr(moderngl.Context, step)

    def refuse_some(self: moderngl.Context, size: tuple[int, int], *arguments: Any, **options: Any) -> Any:
        if 16 < max(size) < 100:
            ctypes.CDLL("libGL.so.1").glEnable(NO_CAPABILITY)
            raise moderngl.Error("the framebuffer is not complete")
        return whole_step(self, size, *arguments, **options)

    monkeypatch.setattr(moderngl.Context, step, refuse_some)


@pytest.mark.parametrize("limit", ["GL_MAX_TEXTURE_SIZE", "GL_MAX_RENDERBUFFER_SIZE", "GL_MAX_VIEWPORT_DIMS"])
def test_a_picture_beyond_the_limits_of_a_device_is_drawn_in_tiles(limit: str, rasterizer, monkeypatch) -> None:
    """A viewport that is too large would be cut off in silence."""
    value: Any = (2048, 24) if limit.endswith("DIMS") else 24
    monkeypatch.setattr(moderngl.Context, "info", rasterizer._context.info | {limit: value})
    with SplatRasterizer() as gl:
        assert draw_splats(gl).tobytes() == draw_splats(rasterizer).tobytes()
        assert gl._target.size == (24, 24)


def test_tiles_are_as_small_as_a_device_has_room_for(rasterizer: SplatRasterizer, monkeypatch) -> None:
    """An error of GL in a refused tile does not count for the picture."""
    refuse_pictures("renderbuffer", monkeypatch)
    monkeypatch.setattr("renderer.draw.splats.splat_rasterizer.SMALLEST_TILE", 4)
    with SplatRasterizer() as gl:
        assert draw_splats(gl).tobytes() == draw_splats(rasterizer).tobytes()
        assert gl._target.size == (16, 16)


def test_a_device_that_has_no_room_for_a_tile(monkeypatch: pytest.MonkeyPatch) -> None:
    """An error of GL in the refused picture does not count for the next one."""
    refuse_pictures("renderbuffer", monkeypatch)
    assert re.fullmatch(
        r"device: the device has no room for a tile of a picture\n  got: 64 x 48 pixels\n"
        r"  hint: end other programs that use the device",
        refusal(),
    )
    with SplatRasterizer() as gl:
        with pytest.raises(RenderError):
            draw_splats(gl)
        splats = place_splats(np.zeros((1, 3)), 0.1)
        assert gl.rasterize([splats], [in_order(splats)], look(size=(16, 16))).any()


def test_a_context_is_lost_while_it_is_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(moderngl.Context, "buffer", refuse)
    with pytest.raises(ContextLostError, match="its context was lost\n  got: cannot create it"):
        SplatRasterizer()


def test_splats_need_a_package_that_some_platforms_install_as_an_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "moderngl", None)
    with pytest.raises(InputError, match="the package moderngl is not installed") as refused:
        open_rasterizer(SCENES["gaussian"])
    assert refused.value.hint == "pip install 'hsplat[splats]'"
