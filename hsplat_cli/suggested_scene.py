"""A volume to the text of a scene that shows it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from hsplat_cli.scene_file import scene_in
from hsplat_cli.scene_text import FilmOptions, scene_text
from hsplat_cli.volume_options import read_as_told
from renderer.colormaps import is_colormap, nearest_colormap
from renderer.errors import InputError, SceneError
from renderer.extents import extent_of, require_proportion, volume_problems
from renderer.scene import VolumeSpec
from renderer.schema import show

# Where the values of a scene came from.
_OPTIONS = {
    "output.background": "--background",
    "output.size": "--size",
    "output.frames_per_second": "--fps",
    "output.file": "the name of the film",
    "error.tolerance": "--tolerance",
    "camera.path.frames": "--frames",
    "camera.path.elevation": "--elevation",
}


@dataclass(frozen=True)
class SuggestedScene:
    """text: the YAML. kind, reason: what the volume is taken for, and why."""

    text: str
    kind: str
    reason: str


def require_colormap(name: str | None) -> None:
    """Raise InputError for a colormap that does not exist."""
    if name is not None and not is_colormap(name):
        close = nearest_colormap(name)
        raise InputError(
            "unknown colormap",
            where="--colormap",
            got=show(name),
            expected="a name such as viridis, gray, cividis_r or crameri:batlow",
            hint=f"did you mean {close}?" if close else None,
        )


def suggest_scene(
    volume: VolumeSpec, film: FilmOptions, *, colormap: str | None, scene: Path, output: Path
) -> SuggestedScene:
    """The scene to be written to the file `scene`. Raises InputError for a volume that cannot be read or drawn, and
    SceneError where an option, such as the background, cannot be in a scene."""
    from renderer.statistics import measure  # noqa: PLC0415  (numpy, for which --help does not wait)
    from renderer.suggestion import suggest  # noqa: PLC0415

    require_colormap(colormap)
    read = read_as_told(volume)
    require_proportion(volume_problems(extent_of(read), read.name))
    suggestion = suggest(read, measure(read.values, read.source), colormap)
    text = scene_text(
        volume,
        suggestion,
        film,
        folder=scene.parent,
        output=output,
        is_float=read.values.dtype.kind == "f",
    )
    _check(text, scene)
    return SuggestedScene(text, suggestion.kind, suggestion.reason)


def _check(text: str, scene: Path) -> None:
    """Raise SceneError for values that cannot be in a scene, such as odd sizes of an MP4, with the options that they
    came from. Nothing has been written yet, so that there is no line to show."""
    try:
        scene_in(text.encode(), scene, overrides=(), volume=None, output=None, still=False)
    except SceneError as error:
        raise SceneError(
            [
                replace(
                    problem,
                    what=problem.what.partition("\n")[0],
                    place=_OPTIONS.get(problem.path, "the scene that was suggested"),
                )
                for problem in error.problems
            ]
        ) from error
