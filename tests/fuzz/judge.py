"""One scene to its verdict: a right picture or a clear error."""

from __future__ import annotations

import contextlib
import io
import os
import re
import signal
import time
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml
from oracle import FLOAT32, DisagreementError, classify, drawn, make_cells
from oracle_splats import Picture, make_picture, view_depths
from scenes import Case, legal_case, random_of
from spoil import spoil

from hsplat_cli.main import run
from hsplat_cli.scene_file import load_scene
from renderer.camera import View
from renderer.errors import HsplatError, InputError
from renderer.octree import Cut, cut_pyramid
from renderer.pipeline import Frame, Stage, finest_level_at, prepare, render_frames, view_of
from renderer.png import encode_png
from renderer.projection import visible_order
from renderer.raster_gl import GLRasterizer
from renderer.scene import Color, Scene
from renderer.splats import make_splats

Array = npt.NDArray[Any]
Float64 = npt.NDArray[np.float64]

# Of a scene of this size, in any state.
PATIENCE_S = 60

# Legal scenes that go through the whole command, too, and have their file compared.
SHARE_OF_COMMANDS = 0.125

# What may be said about a scene of which every part is legal: that there is nothing to fit into the frame.
LEGAL_REFUSALS = ("so there is nothing to frame",)

# A message begins with its place: a file, a part of the scene, an option.
PLACED = re.compile(r"\A(\S.*?): \S")
FAULTS = ("Traceback", "a bug; please report", "this is a fault of hsplat", "unexpected ")


@dataclass
class Verdict:
    """outcome: picture, refused, failed, or wrong, which is the one that must not be; why: of a wrong one, or the
    message. worst: by quantity. kinds: what the scene has, for the summary."""

    index: int
    legal: bool
    spoilt: str
    outcome: str
    why: str = ""
    worst: dict[str, float] = field(default_factory=dict)
    kinds: tuple[str, ...] = ()
    seconds: float = 0.0


class WrongError(AssertionError):
    """The picture or the message is not right."""


def make_case(seed: int, index: int) -> Case:
    """Every second scene is spoilt."""
    rng = random_of(seed, index)
    case = legal_case(index, rng)
    return spoil(case, rng) if index % 2 else case


def write_case(case: Case, folder: Path) -> Path:
    """The scene file and what lies beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in case.files.items():
        (folder / name).write_bytes(content)
    path = folder / "scene.yaml"
    path.write_bytes(case.text if case.text is not None else yaml.safe_dump(case.tree, sort_keys=False).encode())
    return path


def judge(case: Case, folder: Path, rasterizer: GLRasterizer) -> Verdict:
    """Draw the scene in `folder`, which becomes the current one for the time."""
    verdict = Verdict(case.index, not case.spoilt, case.spoilt, "wrong", kinds=_kinds(case))
    start = time.perf_counter()
    try:
        with _inside(folder), _patience(), _loud():
            path = write_case(case, folder)
            if case.spoilt:
                _judge_spoilt(case, path, rasterizer, verdict)
            else:
                _judge_legal(case, path, rasterizer, verdict)
    except (WrongError, DisagreementError) as error:
        verdict.outcome, verdict.why = "wrong", str(error)
    except Exception:  # whatever it was, of the program or of the oracle, it is to be looked at
        verdict.outcome, verdict.why = "wrong", traceback.format_exc(limit=-6)
    verdict.seconds = time.perf_counter() - start
    return verdict


@contextlib.contextmanager
def _inside(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    folder.mkdir(parents=True, exist_ok=True)
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


@contextlib.contextmanager
def _patience() -> Iterator[None]:
    def stop(*_: object) -> None:
        raise TimeoutError(f"more than {PATIENCE_S} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(PATIENCE_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@contextlib.contextmanager
def _loud() -> Iterator[None]:
    with warnings.catch_warnings(), np.errstate(over="raise", divide="raise", invalid="raise"):
        warnings.simplefilter("error")
        yield


def _judge_legal(case: Case, path: Path, rasterizer: GLRasterizer, verdict: Verdict) -> None:
    scene = load_scene(path)
    try:
        frame = _judge_picture(scene, case, rasterizer, verdict)
    except InputError as error:
        if not any(text in str(error) for text in LEGAL_REFUSALS):
            raise WrongError(f"a legal scene was refused: {error}") from error
        verdict.outcome, verdict.why = "refused", str(error)
        return
    if not case.in_memory and random_of(case.index, 1).random() < SHARE_OF_COMMANDS:
        code, message = _command(case, path)
        if code != 0:
            raise WrongError(f"the command ended with {code}: {message}")
        written = Path(str(scene.output.file).format(frame=case.frame)).read_bytes()
        if written != encode_png(frame.image):
            raise WrongError("the command wrote another picture")


def _judge_spoilt(case: Case, path: Path, rasterizer: GLRasterizer, verdict: Verdict) -> None:
    code, message = _command(case, path)
    found = [text for text in FAULTS if text in message]
    if found:
        raise WrongError(f"exit code {code} and {found[0]!r} in: {message}")
    if code == 0:
        overrides = [value for name, value in zip(case.arguments, case.arguments[1:], strict=False) if name == "--set"]
        scene = load_scene(path, overrides=overrides)
        _judge_picture(scene, replace(case, volume=None), rasterizer, verdict)
        return
    if code not in (1, 2) or not PLACED.match(message):
        raise WrongError(f"exit code {code} and no place in: {message}")
    verdict.outcome, verdict.why = ("refused" if code == 2 else "failed"), message


def _command(case: Case, path: Path) -> tuple[int, str]:
    """Exit code and what was said on the standard error stream."""
    said, shown = io.StringIO(), io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(shown):
        code = run(["render", str(path), "--frames", str(case.frame), "--quiet", *case.arguments])
    return code, said.getvalue()


def _judge_picture(scene: Scene, case: Case, rasterizer: GLRasterizer, verdict: Verdict) -> Frame:
    stage = prepare(scene, clock=time.perf_counter, num_threads=1, volume=case.volume if case.in_memory else None)
    if case.volume is not None and not case.in_memory:
        _require_same_volume(stage, case)
    number = min(case.frame, scene.camera.path.frames - 1)
    (frame,) = render_frames(stage, [number], rasterizer, clock=time.perf_counter)
    if not np.isfinite(frame.radiance).all():
        raise WrongError("the picture has pixels that are not numbers")
    view = view_of(stage, number)
    with np.errstate(all="ignore"):
        picture = reference(stage, frame, view)
    if not (np.isfinite(picture.radiance).all() and np.isfinite(picture.bound).all()):
        raise WrongError("the reference has pixels that are not numbers")
    radiance = frame.radiance
    if scene.overlay == "octree":
        radiance = _without_overlay(stage, frame, rasterizer)
    verdict.worst = _compare(radiance, picture)
    if scene.overlay == "none":
        verdict.worst |= _compare_8_bit(frame.image, picture, scene.output.background)
    verdict.outcome = "picture"
    return frame


def _require_same_volume(stage: Stage, case: Case) -> None:
    expected, got = case.volume, stage.volume
    assert expected is not None
    if got.values.dtype != expected.values.dtype or got.values.tobytes() != expected.values.tobytes():
        raise WrongError(f"other voxels were read: {got.values.dtype} {got.values.shape}")
    scale = np.abs(expected.world_from_index).max()
    if np.abs(got.world_from_index - expected.world_from_index).max() > 1e-12 * scale:
        raise WrongError(f"the volume lies elsewhere: {got.world_from_index}, not {expected.world_from_index}")


def reference(stage: Stage, frame: Frame, view: View) -> Picture:
    """What the frame must look like; takes the renderer's cut and order, and verifies them."""
    scene, volume = stage.scene, stage.volume
    finest_level = finest_level_at(stage, frame.tolerance)
    cut = cut_pyramid(stage.pyramid, frame.tolerance, finest_level=finest_level)
    if len(cut) != frame.num_cells:
        raise WrongError(f"{frame.num_cells} cells in the frame, {len(cut)} in its cut")
    field = classify(volume, scene.transfer_function, scene.shading)
    leaves = [(int(level), *map(int, cell)) for level, cell in zip(cut.levels, cut.cells, strict=True)]
    make_cells(field, scene, frame.tolerance, finest_level, leaves)  # type: ignore[arg-type]
    order = visible_order(make_splats(cut, scene.splat), cut, view, scene.splat.order).astype(int)
    left_out = np.setdiff1d(np.arange(len(cut)), order)
    every = [leaves[i] for i in (*left_out, *order)]
    cells = drawn(field, scene, every)  # type: ignore[arg-type]
    is_drawn = np.arange(len(every)) >= len(left_out)
    _require_order(cut, order, view_depths(field, cells, view)[is_drawn], view, scene)
    return make_picture(field, cells, scene, view, is_drawn)


def _require_order(cut: Cut, order: Array, depths: Float64, view: View, scene: Scene) -> None:
    """Back to front: by the depth of the centres, or so that no box hides one that is drawn later."""
    if scene.splat.order == "depth":
        length = float(np.linalg.norm(cut.volume.world_from_index[:3, :3] @ np.array(cut.volume.shape_xyz)))
        behind = np.minimum.accumulate(depths) if len(depths) else depths
        rise = float((depths - behind).max(initial=0.0))
        # Depths are those of float32 centres within half the diagonal.
        if rise > 4 * FLOAT32 * length:
            raise WrongError(f"not back to front: {rise / length:.3g} diagonals")
        return
    low = (cut.cells[order].astype(np.int64) << cut.levels[order, None].astype(np.int64)) - 0.5
    high = np.minimum(low + (1 << cut.levels[order, None].astype(np.int64)), np.array(cut.volume.shape_xyz) - 0.5)
    index_from_world = np.linalg.inv(cut.volume.world_from_index)
    slack = 1e-9
    if view.projection == "perspective":
        eye = index_from_world[:3, :3] @ view.eye + index_from_world[:3, 3]
        slack *= 1 + float(np.abs(eye).max()) + float(np.abs(index_from_world[:3, 3]).max())
    else:
        toward = -index_from_world[:3, :3] @ view.forward
        level = np.abs(toward) < slack * np.abs(toward).max()
        eye = np.where(level, 0.0, np.copysign(np.inf, toward))
        low, high = (np.where(level, 0.0, ends) for ends in (low, high))
        # Along an axis that is seen edge-on no plane hides anything: boxes apart along it are in either order.
        apart_on_edge = [
            (cut.cells[order, k] << cut.levels[order])[:, None] != (cut.cells[order, k] << cut.levels[order])[None]
            for k in np.flatnonzero(level)
        ]
    may_follow = np.zeros((len(order), len(order)), bool)
    for k in range(3):  # whether a plane between the two has the later one on the eye's side
        above = low[None, :, k] >= high[:, None, k]  # the later one lies beyond the earlier one, along this axis
        below = high[None, :, k] <= low[:, None, k]
        may_follow |= above & (eye[k] >= high[:, None, k] - slack)
        may_follow |= below & (eye[k] <= low[:, None, k] + slack)
    if view.projection != "perspective":
        for apart in apart_on_edge:
            may_follow |= apart
    wrong = np.argwhere(np.triu(~may_follow, 1))
    if len(wrong):
        raise WrongError(f"box {wrong[0, 1]} of {len(order)} is drawn over box {wrong[0, 0]}, which may hide it")


def _without_overlay(stage: Stage, frame: Frame, rasterizer: GLRasterizer) -> Array:
    """The same frame without lines, which lie over it."""
    bare = replace(stage, scene=replace(stage.scene, overlay="none"))
    (below,) = render_frames(bare, [frame.number], rasterizer, clock=time.perf_counter)
    # A line hides a share of what is below: 0 to LINE_OPACITY, several lines more, and never brightens it beyond 1.
    hidden = frame.radiance[..., 3] - below.radiance[..., 3]
    if hidden.min() < -1e-6 or frame.radiance.max() > max(1.0, float(below.radiance.max())) + 1e-6:
        raise WrongError("the overlay is not over the picture")
    return below.radiance


def _compare(radiance: Array, picture: Picture) -> dict[str, float]:
    off = np.abs(radiance - picture.radiance)
    excess = off - picture.bound - 1e-30
    if excess.max() > 0:
        row, column, channel = np.unravel_index(excess.argmax(), excess.shape)
        raise WrongError(
            f"row {row}, column {column}, channel {channel}: {radiance[row, column].tolist()} instead of "
            f"{picture.radiance[row, column].tolist()}, bound {picture.bound[row, column].tolist()}; "
            f"{np.count_nonzero(excess.max(axis=2) > 0)} of {off.shape[0] * off.shape[1]} pixels"
        )
    share = off / np.maximum(picture.bound, 1e-12)
    return {
        "radiance": float(off.max()),
        "bound": float(picture.bound.max()),
        "share of the bound": float(share.max()),
    }


def _compare_8_bit(image: Array, picture: Picture, background: Color | None) -> dict[str, float]:
    """Each level must be one that a radiance within the bound can be rounded to."""
    slack = picture.bound + 4 * FLOAT32
    color, alpha = picture.radiance[..., :3], picture.radiance[..., 3:]
    if background is not None:
        value = color + (1 - alpha) * np.array(background)
        more = slack[..., :3] + slack[..., 3:] * np.array(background)
        low, high, exact = value - more, value + more, value
        got = image
    else:
        low = np.maximum(color - slack[..., :3], 0) / np.maximum(alpha + slack[..., 3:], 1e-12)
        high = (color + slack[..., :3]) / np.maximum(alpha - slack[..., 3:], 0.5 / 255)
        exact = color / np.maximum(alpha, 0.5 / 255)
        ends = np.concatenate([low, alpha - slack[..., 3:]], -1), np.concatenate([high, alpha + slack[..., 3:]], -1)
        (low, high), exact = ends, np.concatenate([exact, alpha], -1)
        got = image
        # Where the alpha written is 0 there is no colour.
        is_clear = got[..., 3] == 0
        if got[is_clear].any():
            raise WrongError("a colour where the alpha is 0")
        low[is_clear, :3] = 0
    wrong = (got < _level(low)) | (got > _level(high))
    if wrong.any():
        row, column, channel = np.argwhere(wrong)[0]
        raise WrongError(
            f"8 bits: row {row}, column {column}: {got[row, column].tolist()} instead of "
            f"{_level(exact)[row, column].tolist()}"
        )
    levels = np.abs(got.astype(int) - _level(exact))
    if background is None:
        levels = levels[got[..., 3] > 0]
    return {"levels of 255": float(levels.max(initial=0))}


def _level(values: Float64) -> npt.NDArray[np.int64]:
    return np.clip(np.floor(values * 255 + 0.5), 0, 255).astype(np.int64)


def _kinds(case: Case) -> tuple[str, ...]:
    """What a scene has that is worth a line in the summary."""
    splat, error = case.tree.get("splat"), case.tree.get("error")
    kinds = [
        "gouraud" if isinstance(splat, dict) and splat.get("footprint") == "gouraud" else "gaussian",
        f"measure {error.get('measure', 'optical') if isinstance(error, dict) else 'optical'}",
    ]
    return tuple(kinds)


__all__ = ["Case", "HsplatError", "Verdict", "judge", "make_case", "reference", "write_case"]
