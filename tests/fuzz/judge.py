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
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import yaml
from compare import WrongError, compare_splats
from compare_bricks import compare_bricks
from scenes import DTYPES, Case, legal_case, random_of
from spoil import spoil

from hsplat_cli.main import run
from renderer.draw import Rasterizer
from renderer.errors import InputError
from renderer.film import encode_png
from renderer.frame import Frame, LODCostEstimator, Stage, finest_level_at, prepare_stage, render_frames, view_of
from renderer.job import JobEvents, make_plan
from renderer.pyramid import cut_pyramid
from renderer.scene import FilmScene, Scene, SplatBudget, load_scene, value_at

# Of a scene of this size, in any state.
PATIENCE_S = 60

# Legal scenes that go through the whole command, too, and have their file compared.
SHARE_OF_COMMANDS = 0.125

# What may be said about a scene of which every part is legal: that there is nothing to fit into the frame.
LEGAL_REFUSALS = ("so there is nothing to frame", "and is in frame from any distance")

# A message begins with its place: a file, a part of the scene, an option.
PLACED = re.compile(r"\A(\S.*?): \S")
FAULTS = ("Traceback", "a bug; please report", "this is a fault of hsplat", "unexpected ")


LEGAL = "legal"


@dataclass
class Verdict:
    """The outcome: picture, refused, failed, or wrong, which no scene may have.

    case: how the scene was spoilt, or LEGAL. why: what is wrong, or the message.
    """

    index: int
    case: str
    outcome: str
    why: str = ""
    seconds: float = 0.0


def make_case(seed: int, index: int, dtypes: Sequence[str] = DTYPES) -> Case:
    """Every second scene is spoilt."""
    rng = random_of(seed, index)
    case = legal_case(index, rng, dtypes)
    return spoil(case, rng) if index % 2 else case


def write_case(case: Case, folder: Path) -> Path:
    """The scene file and what lies beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in case.files.items():
        (folder / name).write_bytes(content)
    path = folder / "scene.yaml"
    path.write_bytes(case.text if case.text is not None else yaml.safe_dump(case.tree, sort_keys=False).encode())
    return path


def judge(case: Case, folder: Path, rasterizer_for: Callable[[Scene], Rasterizer]) -> Verdict:
    """Draw the scene in `folder`, which becomes the current one for the time."""
    verdict = Verdict(case.index, case.spoilt or LEGAL, "wrong")
    start = time.perf_counter()
    try:
        with _inside(folder), _hang_policy(), _loud():
            path = write_case(case, folder)
            if case.spoilt:
                _judge_spoilt(case, path, rasterizer_for, verdict)
            else:
                _judge_legal(case, path, rasterizer_for, verdict)
    except WrongError as error:
        verdict.outcome, verdict.why = "wrong", str(error)
    except Exception:  # whatever it was, of the program or of the reference, it is to be looked at
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
def _hang_policy() -> Iterator[None]:
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


def _judge_legal(case: Case, path: Path, rasterizer_for: Callable[[Scene], Rasterizer], verdict: Verdict) -> None:
    scene = load_scene(path)
    try:
        frame = _judge_picture(scene, case, rasterizer_for, verdict)
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


def _judge_spoilt(case: Case, path: Path, rasterizer_for: Callable[[Scene], Rasterizer], verdict: Verdict) -> None:
    code, message = _command(case, path)
    found = [text for text in FAULTS if text in message]
    if found:
        raise WrongError(f"exit code {code} and {found[0]!r} in: {message}")
    if code == 0:
        overrides = [value for name, value in zip(case.arguments, case.arguments[1:], strict=False) if name == "--set"]
        scene = load_scene(path, overrides=overrides, is_single_frame=True)
        _judge_picture(scene, replace(case, volume=None), rasterizer_for, verdict)
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


def _judge_picture(
    scene: FilmScene, case: Case, rasterizer_for: Callable[[Scene], Rasterizer], verdict: Verdict
) -> Frame:
    volumes = [case.volume] if case.in_memory and case.volume is not None else None
    stage = prepare_stage(scene, clock=time.perf_counter, num_threads=1, volumes=volumes)
    if case.volume is not None and not case.in_memory:
        _require_same_volume(stage, case)
    rasterizer, number = rasterizer_for(scene), min(case.frame, scene.at(0).camera.path.frames - 1)
    stage = make_plan(LODCostEstimator(stage), [number], lambda: rasterizer, JobEvents()).stage
    (frame,) = render_frames(stage, [number], rasterizer, clock=time.perf_counter)
    if not np.isfinite(frame.radiance).all():
        raise WrongError("the picture has pixels that are not finite numbers")
    if isinstance(scene.error.goal, SplatBudget):
        _require_finest(stage, frame, value_at(scene.error.goal.value, number))
    view = view_of(stage, number)
    if not scene.needs_opengl:
        compare_bricks(stage, frame, view, rasterizer)
    else:
        with np.errstate(all="ignore"):
            compare_splats(stage, frame, view, rasterizer)
    verdict.outcome = "picture"
    return frame


def _require_finest(stage: Stage, frame: Frame, max_cells: float) -> None:
    """Of at most so many cells: any cut with another number of cells, at a smaller tolerance, has too many."""
    if frame.num_cells > max_cells:
        raise WrongError(f"{frame.num_cells} cells instead of {max_cells}")
    if not stage.scene.needs_opengl:  # whose numbers may fall with the tolerance
        return
    for tolerance in (*(frame.tolerance * factor for factor in (0.3, 0.9, 0.99, 0.9999)), 0.0):
        finer = cut_pyramid(stage.layers[0].pyramid, tolerance, finest_level=finest_level_at(stage.first, tolerance))
        if frame.num_cells < len(finer) <= max_cells:
            raise WrongError(f"{frame.num_cells} cells, {len(finer)} at tolerance {tolerance}, and {max_cells} may be")


def _require_same_volume(stage: Stage, case: Case) -> None:
    expected, got = case.volume, stage.layers[0].volume
    assert expected is not None
    if got.values.dtype != expected.values.dtype or got.values.tobytes() != expected.values.tobytes():
        raise WrongError(f"other voxels were read: {got.values.dtype} {got.values.shape}")
    scale = np.abs(expected.world_from_index).max()
    if np.abs(got.world_from_index - expected.world_from_index).max() > 1e-12 * scale:
        raise WrongError(f"the volume lies elsewhere: {got.world_from_index}, not {expected.world_from_index}")
