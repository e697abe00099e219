"""The Python API: from a scene file, a Scene or a numpy array to pictures, films and the exact picture.

Draws in this process, on all cores, to the same bytes as the command `hsplat render`.
"""

from __future__ import annotations

import base64
import contextlib
import html
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from renderer.errors import InputError, SceneError
from renderer.film import encode_png, frame_path
from renderer.frame import LODCostEstimator, Stage, prepare_stage
from renderer.job import (
    FilmAccuracy,
    FilmJob,
    FilmVisibility,
    JobEvents,
    NotebookBar,
    OnProgress,
    ProgressEvents,
    accuracy_text,
    make_film,
    make_plan,
    one_pass,
    open_local_executor,
    require_annotation,
)
from renderer.readers import is_volume_name, read_volume
from renderer.scene import (
    MAX_DEPTH,
    ArraySource,
    CameraSpec,
    ProceduralSource,
    Scene,
    TransferSpec,
    accuracy_of,
    format_of,
    format_value,
    load_scene as load_scene_file,
    only_output,
    output_suffix,
    parse_scene,
    scene_to_dict,
    short_text,
    spec_to_dict,
)
from renderer.suggest import FilmOptions, Wish, resolve_scene
from renderer.system import num_cores, printable

SceneLike: TypeAlias = "Scene | str | os.PathLike[str] | npt.ArrayLike"
TransferLike: TypeAlias = "str | Sequence[Any] | Mapping[str, Any] | TransferSpec"
CameraLike: TypeAlias = "Mapping[str, Any] | CameraSpec"

# An output that may have any size and background; it is not written.
_ANY_PICTURE = "{frame}.png"
# The parameters by which users of this module know the keys of a scene.
_PARAMETERS = {
    "volume.procedural.spacing": "spacing",
    "volume.procedural.shape": "the array's shape",
    "volume.spacing": "spacing",
    "volume.file": "volume",
    "output.size": "size",
    "output.background": "background",
    "output.file": "output",
    "error.tolerance": "tolerance",
}


class FrameImage(np.ndarray[tuple[int, ...], np.dtype[np.uint8]]):  # npt.NDArray is no class from NumPy 2.5 on
    """A picture: a uint8 array [height, width, 3 or 4] that notebooks display.

    It is a numpy array in every other respect: `image.shape`, `image[:100]`, `np.asarray(image)`. Row 0 is the top. The
    fourth channel, where the background is transparent, is straight alpha.
    """

    def _repr_png_(self) -> bytes | None:
        """Return the picture as a PNG file; None for an array that is not a picture, such as one channel."""
        is_picture = self.dtype == np.uint8 and self.ndim == 3 and self.shape[2] in (3, 4) and self.size > 0
        return encode_png(np.ascontiguousarray(self)) if is_picture else None


@dataclass(frozen=True)
class Film:
    """A film that `render` wrote; notebooks play it.

    Attributes
    ----------
    path: the file, or the template of the numbered frames, such as `frames/{frame:04}.png`.
    frames: the numbers of its frames.
    sidecar: the JSON file beside it, which records how it was made and what each frame cost.
    notes: what you should know about it, such as that nothing is in view; mostly empty.
    accuracy: how exact its frames are, by exact rays: `psnr` in decibels, its 95 % `interval`, the `worst` frame, and
        as `file.psnr` what the file keeps of them; None where nothing was measured.
    visibility: which scalars its frames show, by the same rays: `coverage`, the mean opacity, and `ranges` of scalars
        with `low`, `high` and their `share` of what is visible; None where nothing was measured.
    """

    path: Path
    frames: tuple[int, ...]
    sidecar: Path
    notes: tuple[str, ...] = ()
    accuracy: FilmAccuracy | None = None
    visibility: FilmVisibility | None = None

    def _repr_html_(self) -> str:
        """Return the film, or its first picture, with a caption."""
        first, kind = frame_path(self.path, self.frames[0]), format_of(self.path).media_type
        data = f"data:{kind};base64,{base64.b64encode(first.read_bytes()).decode()}"
        element = '<img src="{}">' if kind.startswith("image/") else '<video controls loop muted src="{}"></video>'
        count = f"{len(self.frames)} frame{'s' * (len(self.frames) != 1)}"
        exact = [] if self.accuracy is None else [accuracy_text(self.accuracy)]
        lines = [f"{self.path}: {count}; how it was made: {self.sidecar}", *exact, *self.notes]
        caption = "<br>".join(html.escape(printable(line)) for line in lines)
        return f"<figure>{element.format(data)}<figcaption>{caption}</figcaption></figure>"


def load_scene(path: str | os.PathLike[str], *, overrides: Sequence[str] = ()) -> Scene:
    """Read and check a scene file.

    Parameters
    ----------
    path: a YAML file; docs/scene.md lists its keys.
    overrides: changes such as `"error.tolerance=0.2"`, as `--set` of the command has them.

    Returns the scene, a frozen dataclass: `dataclasses.replace` makes others from it.
    Raises SceneError, an InputError, with everything that is wrong, line by line.

    Example
    -------
    >>> scene = renderer.load_scene("scene.yaml", overrides=["output.size=[256, 256]"])
    """
    is_list = isinstance(overrides, Sequence) and not isinstance(overrides, (str, bytes))
    if not is_list or not all(isinstance(each, str) for each in overrides):
        expected = 'a list of texts, such as ["error.tolerance=0.2"]'
        raise InputError("not a list of overrides", where="overrides", got=_repr(overrides), expected=expected)
    return load_scene_file(_scene_file(path), overrides=overrides)


def suggest_scene(
    volume: str | os.PathLike[str] | npt.ArrayLike,
    *,
    spacing: Sequence[float] | None = None,
    transfer_function: TransferLike | None = None,
    camera: CameraLike | None = None,
    size: tuple[int, int] | None = None,
    background: str | Sequence[float] | None = None,
    tolerance: float | None = None,
    output: str | os.PathLike[str] | None = None,
) -> Scene:
    """Make a scene that shows a volume: a turntable, with a transfer function that suits the values.

    Parameters
    ----------
    volume: an array [z, y, x] of integers, booleans or floats, which is never changed; or the name of a volume's file.
    spacing: lengths of a voxel along (x, y, z), in world units; 1 by default, and for a file what the file says.
    transfer_function: by default one is suggested, as by `hsplat init`. Else the name of a colormap, from which the
        suggestion takes its colours; or `{"preset": "bone"}`, with what `hsplat init --preset` takes; or control points
        `(value, color, opacity)`; or a mapping or a TransferSpec, as in a scene file, or `{"labels": {...}}`. Opacities
        are per smallest spacing.
    camera: a mapping or a CameraSpec, as in a scene file. What a mapping leaves out is that of a turntable of 120
        frames, 20 degrees above the object, framed so that nothing is cut off.
    size: (width, height) of the pictures, pixels; 512 x 512 by default.
    background: a colour; black by default. "transparent" needs a format that has alpha.
    tolerance: the error that is allowed, 0.05 by default. A smaller one is more exact and slower; 0 draws every voxel.
    output: the file that `render` writes; film.mp4 by default.

    Returns the scene. Voxels that are NaN, infinite or have a fill value are left out.
    Raises InputError for an array or a file that is no volume, SceneError for parameters that cannot be in a scene.

    Example
    -------
    >>> scene = renderer.suggest_scene(array, spacing=(0.5, 0.5, 1.2))
    """
    options: dict[str, Any] = {"spacing": spacing, "transfer_function": transfer_function, "camera": camera}
    options |= {"size": size, "background": background, "tolerance": tolerance, "output": output}
    return _scene(volume, options, is_volume=True)


def render_frame(
    scene: SceneLike,
    frame: int = 0,
    *,
    spacing: Sequence[float] | None = None,
    transfer_function: TransferLike | None = None,
    camera: CameraLike | None = None,
    size: tuple[int, int] | None = None,
    background: str | Sequence[float] | None = None,
    tolerance: float | None = None,
) -> FrameImage:
    """Draw one frame, and write nothing.

    Parameters
    ----------
    scene: a Scene, the name of a scene file, or a volume: an array [z, y, x] or a name, for which a scene is suggested.
    frame: its number on the camera's path; -1 is the last one.
    spacing, transfer_function, camera, size, background, tolerance: as in `suggest_scene`; with a scene, they replace
        what it says.

    Returns the picture: a uint8 array [height, width, 3], or [height, width, 4] with straight alpha where the
    background is transparent. It has the bytes that `hsplat render` writes.
    Raises InputError, SceneError, and RenderError where a scene with splats finds no OpenGL.

    Example
    -------
    >>> image = renderer.render_frame(array, spacing=(1, 1, 2), background="white")
    """
    options: dict[str, Any] = {"spacing": spacing, "transfer_function": transfer_function, "camera": camera}
    # Nothing is written: whatever the output is, the picture may be odd in size or transparent.
    options |= {"size": size, "background": background, "tolerance": tolerance, "output": _ANY_PICTURE}
    made = _scene(scene, options)
    numbers = [_number(frame, made)]
    with open_local_executor(made) as executor, _open_stage(made) as stage:
        require_annotation(stage, numbers)
        plan = make_plan(LODCostEstimator(stage), numbers, lambda: executor.rasterizer, JobEvents())
        (drawn,) = executor.draw(plan, numbers)
        drawn = drawn.finished() if made.annotation.shows_anything else drawn
    image: FrameImage = drawn.pictures[0].pixels.view(FrameImage)
    return image


def render(
    scene: SceneLike,
    *,
    output: str | os.PathLike[str] | None = None,
    frames: int | slice | Sequence[int] | None = None,
    best_effort: bool = False,
    resume: bool = True,
    on_progress: OnProgress | None = None,
) -> Film:
    """Draw a film and write it, with its sidecar: the job of the command `hsplat render`, to the same bytes.

    The file is written whole or not at all, and it never replaces one of the scene's inputs. A film that is up to date
    is not drawn again, and one that was stopped, here or by the command, resumes where it stopped.

    Parameters
    ----------
    scene: a Scene, the name of a scene file, or a volume: an array [z, y, x] or a name, for which a scene is suggested.
    output: the file to write, in place of the scene's: film.mp4, film.webp and so on, a template such as
        `frames/{frame:04}.png` or, for one frame, a .png. It is made alone; a scene may have several.
    frames: the frames to draw, ascending: `range(0, 30)`, `slice(None, None, 10)`, `-1`; all by default.
    best_effort: accept a film that is less accurate than the scene asks for. A budget of seconds is kept as well as
        this machine can; frames that take longer are no error.
    resume: keep the frames that an earlier job finished. Without it every frame is drawn, as with `--force`.
    on_progress: called as `on_progress(num_finished, num_frames)` after each frame that is drawn. What it raises ends
        the job, which can be resumed. By default notebooks show a bar.

    Returns the Film, which notebooks play.
    Raises InputError, SceneError, OutputLockedError if another job is writing the same output, and RenderError if the
    film cannot be written or is less accurate than the scene asks for; the film is written in the latter case, too.

    Example
    -------
    >>> film = renderer.render("scene.yaml", output="draft.gif", frames=range(0, 120, 10))
    >>> film.path, film.sidecar
    """
    made = _scene(scene, {"output": output}, is_single_frame=True)
    numbers = _numbers(frames, made)
    made = _scene(made, {}, is_single_frame=len(numbers) == 1)
    is_file = isinstance(scene, (str, os.PathLike)) and not is_volume_name(scene)
    path = _scene_file(scene) if is_file else None
    job = FilmJob(made, numbers, accuracy_of(made.error), path=path)
    events = ProgressEvents(on_progress or NotebookBar())
    film = make_film(job, open_local_executor, one_pass, events, resumes=resume)
    if film.shortfall is not None and not best_effort:
        raise film.shortfall
    notes = [film.volume_note] if film.volume_note else []
    record = film.record
    told = record.accuracy, record.visibility
    return Film(film.file, record.numbers, film.sidecar, (*notes, *record.notes), *told)


def integrate(scene: SceneLike, frame: int = 0) -> npt.NDArray[np.float32]:
    """Compute the exact picture of a frame: the converged ray integral, without pyramid, cells or tolerance.

    It takes far longer than drawing: use small pictures.

    Parameters
    ----------
    scene: a Scene, the name of a scene file, or a volume: an array [z, y, x] or a name, for which a scene is suggested.
    frame: its number on the camera's path; -1 is the last one.

    Returns float32 [height, width, 3], colours from 0 to 1 over the scene's background; a transparent one counts as
    black. Every channel is within about 1e-5 of the integral.
    Raises InputError, SceneError, and RenderError where the integral does not converge.

    Example
    -------
    >>> error = renderer.render_frame(scene) / 255 - renderer.integrate(scene)
    >>> psnr = -10 * np.log10(np.mean(error**2))
    """
    from renderer.accuracy import TRUTH_TOLERANCE, compute_truth

    made = _scene(scene, {"output": _ANY_PICTURE})
    number = _number(frame, made)
    with _open_stage(made) as stage:
        truth = compute_truth(stage, number, TRUTH_TOLERANCE, num_threads=num_cores())
    return truth.picture.astype(np.float32)


# Scenes


def _scene(
    source: SceneLike, options: Mapping[str, Any], *, is_volume: bool = False, is_single_frame: bool = False
) -> Scene:
    """Return a checked scene with these options in it; those that are None are not given.

    is_volume: a name is that of a volume's file, and not of a scene file.
    """
    if isinstance(source, (str, os.PathLike)) and not (is_volume or is_volume_name(source)):
        source = load_scene_file(_scene_file(source), is_single_frame=True)
    given = {name: _plain(value) for name, value in options.items() if value is not None}
    is_new, array = not isinstance(source, Scene), None
    if isinstance(source, Scene):
        tree, array = scene_to_dict(source), source.volume.source
    elif isinstance(source, (str, os.PathLike)):
        tree = _turntable() | {"volume": {"file": os.fspath(source)}}
    else:
        tree, array = _turntable() | {"volume": {}}, _array_source(source)
    if isinstance(array, ArraySource):  # of which only the shape and the spacing can be parsed
        section = {"name": "constant", "shape": list(array.shape), "spacing": given.pop("spacing", array.spacing)}
        tree["volume"] = {key: value for key, value in tree["volume"].items() if key != "array"}
        tree["volume"]["procedural"] = section
    wish = _wish(given.get("transfer_function"))
    scene = _parse(_with_options(tree, given), is_single_frame=is_single_frame)
    if isinstance(array, ArraySource):
        assert isinstance(scene.volume.source, ProceduralSource)
        placed = replace(array, spacing=scene.volume.source.spacing)
        scene = replace(scene, volume=replace(scene.volume, source=placed))
    if isinstance(source, Scene) and "transfer_function" not in given:  # plain data do not say where it is from
        scene = replace(scene, transfer_function=source.transfer_function)
    suggests = wish is not None or (is_new and "transfer_function" not in given)
    return resolve_scene(_with_suggestion(scene, wish) if suggests else scene, read_volume)


def _wish(transfer_function: Any) -> Wish | None:
    """Return what a suggestion shall be, if an option asks for one."""
    match transfer_function:
        case str(colormap):
            return Wish(colormap)
        case {"preset": str(preset), **others} if not others:
            return Wish(preset=preset)
    return None


def _turntable() -> dict[str, Any]:
    """Return what `hsplat init` suggests, too, with a transfer function that is still to be replaced."""
    film = FilmOptions()
    path = {"type": "turntable", "frames": film.frames, "elevation": film.elevation, "axis": film.axis}
    return {
        "transfer_function": {"points": [{"value": 0, "color": "white", "opacity": 1}]},
        "camera": {"target": "visible", "path": path},
        "error": {"tolerance": film.tolerance},
        "output": {"file": "film.mp4"},
    }


def _scene_file(name: Any) -> Path:
    """Return the path of a scene file. Raises InputError for anything but a name."""
    if not isinstance(name, (str, os.PathLike)) or not isinstance(os.fspath(name), str) or not os.fspath(name):
        raise InputError("not the name of a scene file", got=_repr(name), expected="a name such as scene.yaml")
    return Path(name)


def _array_source(values: npt.ArrayLike) -> ArraySource:
    if np.ma.is_masked(values):
        raise InputError(
            "a masked array, whose masked voxels would be drawn",
            expected="an array without a mask",
            hint="`array.astype(float).filled(numpy.nan)` hides the masked voxels, as NaN is hidden",
        )
    try:
        array = values if isinstance(values, np.memmap) else np.asarray(values)
    except (ValueError, TypeError, RuntimeError) as error:  # ragged lists; tensors that are on another device
        got = short_text(" ".join(str(error).split()))
        raise InputError(
            "this cannot be made an array", got=got, expected="numbers in three axes, [z, y, x]"
        ) from error
    if array.ndim != 3:
        what = "the array does not have the axes of a volume"
        got = f"shape {format_value(list(array.shape))}" if array.ndim else _repr(values)
        raise InputError(what, got=got, expected="three axes, [z, y, x]")
    return ArraySource(array.view(np.uint8) if array.dtype == np.bool_ else array)


def _plain(value: Any, num_levels: int = MAX_DEPTH) -> Any:
    """Return an option as a scene file would have it. Raises InputError for more than this number of levels."""
    if num_levels == 0:
        raise InputError(f"an option of more than {MAX_DEPTH} levels", hint="does it contain itself?")
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, CameraSpec):  # all of it, with what it leaves to its defaults
        return {"target": None, "distance": None} | spec_to_dict(value)
    if isinstance(value, TransferSpec):
        return {"labels": spec_to_dict(value)} if value.labels is not None else spec_to_dict(value)
    if isinstance(value, Mapping):
        return {key: _plain(item, num_levels - 1) for key, item in value.items()}
    return [_plain(item, num_levels - 1) for item in value] if isinstance(value, (list, tuple)) else value


def _with_options(tree: dict[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return a scene's tree with options of `suggest_scene` in it."""
    if "spacing" in given:
        tree["volume"]["spacing"] = given["spacing"]
    if "camera" in given:
        camera = given["camera"]
        if isinstance(camera, dict):
            camera = {key: value for key, value in (tree["camera"] | camera).items() if value is not None}
        tree["camera"] = camera
    if "tolerance" in given:
        rest = {key: value for key, value in tree["error"].items() if key in ("measure", "of", "finest_level")}
        tree["error"] = rest | {"tolerance": given["tolerance"]}
    names = {"output": "file", "size": "size", "background": "background"}
    if "output" in given:
        tree["output"] = only_output(tree["output"], output_suffix(str(given["output"])))
    first = tree["output"][0] if isinstance(tree["output"], list) else tree["output"]
    first |= {key: given[name] for name, key in names.items() if name in given}
    if "transfer_function" in given:
        tree.pop("labels", None)
    match given.get("transfer_function"):
        case {"labels": labels, **others} if not others:
            tree.pop("transfer_function", None)
            tree["labels"] = labels
        case str(colormap):  # the rest is suggested
            tree["transfer_function"] = {"colormap": colormap, "range": [0, 1], "opacity": [[0, 1]]}
        case [*points]:
            tree["transfer_function"] = {"points": [_control_point(point) for point in points]}
        case section if section is not None and _wish(section) is None:
            tree["transfer_function"] = section
    return tree


def _control_point(point: Any) -> Any:
    """Return `(value, color, opacity)` as a mapping."""
    keys = ("value", "color", "opacity")
    is_triple = isinstance(point, list) and len(point) == len(keys)
    return dict(zip(keys, point, strict=True)) if is_triple else point


def _parse(tree: dict[str, Any], *, is_single_frame: bool) -> Scene:
    try:
        return parse_scene(tree, base=Path.cwd(), is_single_frame=is_single_frame)
    except SceneError as error:
        raise SceneError([replace(each, path=_parameter(each.path)) for each in error.problems]) from None


def _parameter(path: str) -> str:
    """Return what the user calls a key of the scene."""
    key = next((key for key in _PARAMETERS if path == key or path.startswith(f"{key}.")), None)
    return path if key is None else _PARAMETERS[key] + path.removeprefix(key)


def _with_suggestion(scene: Scene, wish: Wish | None) -> Scene:
    """Return the scene with all that is suggested for its volume."""
    from renderer.suggest import suggest_for

    return suggest_for(scene.volume, read_volume, wish=wish or Wish()).applied_to(scene)


def _number(frame: int, scene: Scene) -> int:
    """Return the number of this frame of the scene's path. Raises InputError where it is not on it."""
    if not isinstance(frame, (int, np.integer)):
        raise InputError("not the number of a frame", where="frame", got=_repr(frame), expected="a whole number")
    return _numbers(frame, scene)[0]


def _numbers(frames: int | slice | Sequence[int] | None, scene: Scene) -> Sequence[int]:
    """Return the numbers of these frames of the scene's path. Raises InputError where they are not on it."""
    path = range(scene.num_frames)
    with contextlib.suppress(IndexError, TypeError, ValueError):  # ValueError: a slice with the step 0
        if frames is None or isinstance(frames, slice):
            picked: Sequence[int] = path[frames or slice(None)]
        else:
            picked = [path[frames]] if isinstance(frames, (int, np.integer)) else [path[frame] for frame in frames]
        if picked and list(picked) == sorted(set(picked)):
            return picked
    expected = f"whole numbers from 0 to {path[-1]}, ascending, or from -1 for the last one"
    raise InputError("no such frames", where="frames", got=_repr(frames), expected=expected)


def _repr(value: object) -> str:
    """Return an argument as Python writes it, cut to a readable length."""
    return short_text(repr(value))


def _open_stage(scene: Scene) -> Stage:
    return prepare_stage(scene, clock=perf_counter, num_threads=num_cores())
