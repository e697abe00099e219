"""VTK's volume mappers on hsplat's scene: the same voxels, transfer function, cameras and truth.

VTK draws in a process of its own (`vtk_worker.py`), so that its GL context and its faults stay out of this one. It is
given lengths in units of the finest spacing and the origin at the volume's centre, because it computes in float32.

What is VTK's and shows in its figures: look-up tables in place of the transfer function, 15 bits of opacity in the
fixed-point mapper, and frames of 8 bits, which alone are 59 dB on the pixels that a volume covers.
"""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.errors import InputError, RenderError, require_package
from renderer.film import translate_os_errors
from renderer.scene import Color, Scene
from renderer.study import (
    Accuracy,
    FloatImage,
    FrameMeasurement,
    Measurement,
    Setting,
    Truth,
    difference_thumbnail,
    measure_accuracy,
    pool_accuracies,
    thumbnail,
)
from renderer.transfer import TransferFunction
from renderer.view import View
from renderer.volume import Array, Float64, Volume, make_volume

# Sample distances, in units of the finest spacing, and the part of the pixels that are drawn, 1 of n x n.
_SAMPLE_DISTANCES = (0.5, 1.0, 2.0, 4.0)
_IMAGE_REDUCTIONS = {"gpu": (1, 2), "fixed point": (1, 2, 4)}

# What both mappers draw as it is; the rest they convert, in ways of their own, or refuse.
_NATIVE_DTYPES = ("int8", "uint8", "int16", "uint16", "float32")

# VTK is linear in the opacity where hsplat is in the extinction: between points so close in optical depth the two
# differ by 0.02^2 / 8 = 5e-5.
_DEPTH_BETWEEN_POINTS = 0.02
# How wide VTK's ramps are that stand for a step, in parts of the transfer function's range: less than its tables show.
_STEP_WIDTH = 1e-6

_SCRIPT = Path(__file__).with_name("vtk_worker.py")
# The worker's standard error stream: a pipe that nobody reads would stop it when full.
_ERRORS = "errors.txt"

# VTK's near plane must be in front of the eye; this part of the far plane's depth keeps float32 depths apart.
_NEAREST_PART = 1e-4
# A worker that has not finished a frame, or told what VTK it has, for so long is taken for dead.
_FRAME_TIMEOUT_S = 600.0
_START_TIMEOUT_S = 120.0
_EXIT_TIMEOUT_S = 10.0
_NUM_LAST_LINES = 8
_TERMINAL_COLOR = re.compile(r"\x1b\[[0-9;]*m")


def vtk_settings() -> tuple[Setting, ...]:
    """Both mappers from fine to coarse: steps along the ray, in units of the finest spacing, on ever fewer pixels."""
    return tuple(
        Setting(
            f"vtk {mapper}",
            f"step {distance:g}" + (f", 1/{reduction**2} px" if reduction > 1 else ""),
            {"tool": "vtk", "mapper": mapper, "sample_distance": distance, "image_reduction": reduction},
        )
        for mapper, reductions in _IMAGE_REDUCTIONS.items()
        for reduction in reductions
        for distance in _SAMPLE_DISTANCES
    )


def check_vtk(scene: Scene) -> None:
    """Raise InputError where VTK is not installed, or would draw another thing than the scene asks for."""
    require_package("vtk", extra="vtk")
    if scene.shading is not None:
        raise InputError(
            "VTK cannot be compared on a scene with shading: its light is another model",
            where="shading",
            hint="measure without the peer, or without shading",
        )


def describe_vtk() -> dict[str, str]:
    """VTK's `version`, and the `driver` that it draws with. Raises RenderError where it has none, dies or hangs."""
    try:
        done = subprocess.run(
            [sys.executable, str(_SCRIPT)],
            check=True,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=_START_TIMEOUT_S,
        )
    except subprocess.TimeoutExpired as error:
        raise _vtk_error("VTK does not start", "--peer vtk", f"no answer for {error.timeout:g} s", "") from error
    except subprocess.CalledProcessError as error:
        raise _vtk_error("VTK does not start", "--peer vtk", f"exit status {error.returncode}", error.stderr) from error
    return dict(json.loads(done.stdout))


def with_transparent_border(volume: Volume, transfer: TransferFunction) -> Volume:
    """The volume with its outermost layer of voxels set to a value that is not seen.

    VTK's volume ends at the outer voxel centres, hsplat's half a voxel further out; with such a border that makes no
    difference. The value is the lowest of the volume where that is transparent, else the highest, else the transparent
    one nearest to what the volume holds. Raises InputError where its type has none or nothing would be left, and
    where the volume's file was changed.
    """
    if min(volume.shape_xyz) < 3:
        raise InputError(
            "the volume is too thin to be compared with VTK, which draws nothing beyond the outer voxel centres",
            where=volume.name,
            got=" x ".join(map(str, volume.shape_xyz)),
            expected="at least 3 voxels along each axis",
        )
    value = _transparent_value(volume.values, transfer)
    if value is None:
        raise InputError(
            "the transfer function hides no value, so that the volume cannot be given the transparent border that a "
            "comparison with VTK needs",
            where=volume.name,
            expected=f"an opacity of 0 at some value of type {volume.values.dtype}",
            hint="measure without the peer",
        )
    values = np.full_like(volume.values, value)
    inner = (slice(1, -1),) * 3
    values[inner] = volume.values[inner]
    volume.require_unchanged()
    return make_volume(values, volume.world_from_index, f"{volume.name} with a transparent border")


def _transparent_value(values: Array, transfer: TransferFunction) -> Any:
    """A scalar of the type of the values that has no extinction, or None.

    Where there is one at all, one of the ends of a stretch of such values is, rounded into the type to either side.
    """
    dtype = values.dtype
    lowest, highest = values.min(), values.max()
    if np.issubdtype(dtype, np.integer):
        ends = [int(ending) for value in transfer.values for ending in (math.floor(value), math.ceil(value))]
        limits = np.iinfo(dtype)
        rounded = np.array([min(max(ending, limits.min), limits.max) for ending in ends], dtype)
    else:
        largest = np.finfo(dtype).max
        near = np.clip(transfer.values, -float(largest), float(largest)).astype(dtype)
        rounded = np.concatenate([near, np.nextafter(near, -largest), np.nextafter(near, largest)])
    halves = rounded.astype(np.float64) / 2  # differences of whole ones may be infinite
    distance = np.maximum(np.maximum(float(lowest) / 2 - halves, halves - float(highest) / 2), 0)
    candidates = np.concatenate([np.array([lowest, highest], dtype), rounded[np.argsort(distance, kind="stable")]])
    hidden = candidates[transfer.classify(candidates)[1] == 0]
    return hidden[0] if hidden.size else None


def measure_vtk(
    volume: Volume,
    transfer: TransferFunction,
    views: Sequence[View],
    truths: Sequence[Truth],
    background: Color | None,
    *,
    settings: Sequence[Setting],
    repeats: int,
) -> Iterator[Measurement]:
    """Each of the settings, as soon as it is measured.

    volume: has a transparent border, and the truths were made from it. background: None is black.
    views, truths: one for each frame.
    settings: of `vtk_settings()`.
    repeats: passes over the frames that are timed, drawing and reading back, after a first one that warms up and gives
        the pictures: the order in which hsplat's own are measured.

    Raises RenderError when VTK fails, dies or hangs. Closing the iterator ends its process.
    """
    with _folder(volume, transfer, views, background) as folder, _worker(folder) as worker:
        for setting in settings:
            options = dict(setting.options)
            accuracies: list[Accuracy] = []
            small: list[npt.NDArray[np.uint8]] = []
            for k, truth in enumerate(truths):
                worker.draw(options, k)
                picture = worker.picture()
                accuracies.append(measure_accuracy(picture, truth.picture, truth.on_volume))
                small = small or [thumbnail(picture), difference_thumbnail(picture, truth.picture)]
            passes = [[worker.draw(options, k) for k in range(len(truths))] for _ in range(repeats)]
            times = zip(*passes, strict=True)
            yield Measurement(
                setting=setting,
                num_cells=None,
                pyramid_seconds=None,
                seconds={},
                frames=tuple(
                    FrameMeasurement(truth.frame, None, {"draw": seconds}, accuracy)
                    for truth, seconds, accuracy in zip(truths, times, accuracies, strict=True)
                ),
                overall=pool_accuracies(accuracies),
                peak_bytes=None,
                picture=small[0],
                difference=small[1],
            )


@contextmanager
def _folder(
    volume: Volume, transfer: TransferFunction, views: Sequence[View], background: Color | None
) -> Iterator[Path]:
    """What the worker reads, in a folder that is gone after the block."""
    finest = volume.finest_spacing
    voxels, lowest, half_span = _convert_voxels(volume.values)
    points = _points(transfer, finest)
    points[:, 0] = (points[:, 0] / 2 - lowest / 2) / half_span
    job = {
        **_image_geometry(volume),
        "points": points.tolist(),
        "background": background or (0.0, 0.0, 0.0),
        "cameras": [_camera(volume, view) for view in views],
    }
    with tempfile.TemporaryDirectory(prefix="hsplat-vtk-") as name:
        folder = Path(name)
        with translate_os_errors(folder):
            (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
            np.save(folder / "voxels.npy", voxels, allow_pickle=False)
        del voxels
        yield folder


def _convert_voxels(values: Array) -> tuple[Array, float, float]:
    """Voxels as VTK draws them, and the (lowest, half the span) for which they are `(value - lowest) / span`.

    Types that it has no texture for become float32 in [0, 1], so that values far from 0 keep their differences. All is
    reckoned in halves, because the span of float64 may be infinite.
    """
    if values.dtype.name in _NATIVE_DTYPES:
        return values, 0.0, 0.5
    lowest, highest = float(values.min()), float(values.max())
    half_span = highest / 2 - lowest / 2 or 0.5
    scaled = np.empty(values.shape, np.float32)
    for layer, of in zip(scaled, values, strict=True):  # layer by layer: there may be no memory for all in float64
        layer[...] = (of.astype(np.float64) / 2 - lowest / 2) / half_span
    return scaled, lowest, half_span


def _points(transfer: TransferFunction, unit: float) -> Float64:
    """float64 [n, 5]: value, colour and opacity per `unit` of length, values ascending, between which VTK is linear."""
    values = transfer.values.copy()
    width = _STEP_WIDTH * ((values[-1] - values[0]) or max(abs(values[0]), 1.0))
    is_step = values[:-1] == values[1:]
    values[:-1][is_step] -= width
    depth = transfer.extinctions * unit
    # Where each new point lies in the sequence of old ones: 0, 0.25, 0.5, 0.75, 1, 2, ...
    counts = np.maximum(np.ceil(np.abs(np.diff(depth)) / _DEPTH_BETWEEN_POINTS), 1).astype(int)
    at = np.concatenate([*(k + np.arange(count) / count for k, count in enumerate(counts)), [len(values) - 1]])
    columns = [np.interp(at, np.arange(len(values)), column) for column in (values, *transfer.colors.T, depth)]
    columns[4] = -np.expm1(-columns[4])
    return np.column_stack(columns)


def _image_geometry(volume: Volume) -> dict[str, Any]:
    """Where the voxels lie: spacing along the image's axes, and float [4][4] from there to the world of the job."""
    finest = volume.finest_spacing
    world_from_image = np.eye(4)
    world_from_image[:3, :3] = volume.world_from_index[:3, :3] / volume.spacing
    world_from_image[:3, 3] = (volume.world_from_index[:3, 3] - volume.centre) / finest
    return {"spacing": (volume.spacing / finest).tolist(), "world_from_image": world_from_image.tolist()}


def _camera(volume: Volume, view: View) -> dict[str, Any]:
    """A View in VTK's words, in the world of the job."""
    finest = volume.finest_spacing
    eye = (view.eye - volume.centre) / finest
    half_extent = np.abs(volume.world_from_index[:3, :3]) @ np.array(volume.shape_xyz) / 2 / finest
    depth, reach = float(-eye @ view.forward), float(np.linalg.norm(half_extent))
    farthest = max(depth + reach, 1.0)
    nearest = max(depth - reach, view.near / finest, farthest * _NEAREST_PART)
    width, height = view.size
    half_height = height / 2 / view.scale_px  # of the picture: as a tangent in perspective, as a length otherwise
    if view.projection == "orthographic":
        lens = {"half_height": half_height / finest}
    else:
        lens = {"angle_deg": math.degrees(2 * math.atan(half_height))}
    return {
        "size": (width, height),
        "eye": eye.tolist(),
        "focus": (eye + view.forward).tolist(),
        "up": view.axes[1].tolist(),
        **lens,
        "clipping": (nearest, max(farthest, nearest * 2)),
    }


@contextmanager
def _worker(folder: Path) -> Iterator[_Worker]:
    """VTK's process, which has ended after the block."""
    with (folder / _ERRORS).open("wb") as stream:
        process = subprocess.Popen(
            [sys.executable, str(_SCRIPT), str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=stream,
            encoding="utf-8",
        )
    try:
        yield _Worker(process, folder)
    finally:
        process.kill()
        process.communicate()  # waits and closes the pipes


class _Worker:
    """One order at a time."""

    def __init__(self, process: subprocess.Popen[str], folder: Path) -> None:
        self._process, self._folder = process, folder

    def draw(self, setting: dict[str, Any], camera: int) -> float:
        """Draw a frame, once, and return the seconds that it took."""
        assert self._process.stdin is not None and self._process.stdout is not None
        hung = threading.Event()

        def give_up() -> None:
            hung.set()
            self._process.kill()

        silence = threading.Timer(_FRAME_TIMEOUT_S, give_up)
        silence.start()
        try:
            self._process.stdin.write(json.dumps({"setting": setting, "camera": camera}) + "\n")
            self._process.stdin.flush()
            answer = self._process.stdout.readline()
        except OSError:  # a broken pipe
            answer = ""
        finally:
            silence.cancel()
        if not answer.endswith("\n"):
            raise self._failure(setting, hung=hung.is_set())
        return float(json.loads(answer)["seconds"])

    def picture(self) -> FloatImage:
        """That which was drawn last."""
        return np.asarray(np.load(self._folder / "picture.npy", allow_pickle=False) / 255.0)

    def _failure(self, setting: dict[str, Any], *, hung: bool) -> RenderError:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_EXIT_TIMEOUT_S)  # its answers have ended, it is about to
        ending = f"no answer for {_FRAME_TIMEOUT_S:g} s" if hung else f"exit status {self._process.returncode}"
        stderr = (self._folder / _ERRORS).read_text(encoding="utf-8", errors="replace")
        where = f"vtk {setting['mapper']}, step {setting['sample_distance']:g}"
        return _vtk_error("VTK failed to draw a frame", where, ending, stderr)


def _vtk_error(what: str, where: str, ending: str, stderr: str) -> RenderError:
    """How its process ended, and the last of the words that it left on its standard error stream."""
    last = [line for line in _TERMINAL_COLOR.sub("", stderr).splitlines() if line.strip()][-_NUM_LAST_LINES:]
    return RenderError(what, where=where, got="\n    ".join([ending, *last]), hint="measure without the peer")
