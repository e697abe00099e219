"""A volume to the text of a scene that shows it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from hsplat_cli.scene_file import scene_in
from hsplat_cli.scene_text import FilmOptions, scene_text
from hsplat_cli.volume_options import read_as_told
from renderer.colormaps import is_colormap, nearest_colormap
from renderer.errors import InputError, SceneError
from renderer.extents import extent_of, require_proportion, volume_problems
from renderer.scene import VolumeSpec
from renderer.schema import show

if TYPE_CHECKING:
    from renderer.suggestion import Suggestion
    from renderer.volume import Volume

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
    """text: the YAML. kind, reason: what the volume is taken for, and why. nonfinite: how many voxels are no numbers,
    and what becomes of them; None where all are."""

    text: str
    kind: str
    reason: str
    nonfinite: str | None = None


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
    volume: VolumeSpec,
    film: FilmOptions,
    *,
    colormap: str | None,
    scene: Path,
    output: Path,
    hides_nonfinite: bool = False,
) -> SuggestedScene:
    """The scene to be written to the file `scene`.

    hides_nonfinite: NaN and infinities get a value that is not seen, in place of the `lowest` that `volume` asks for.

    Raises InputError for a volume that cannot be read or drawn, and
    SceneError where an option, such as the background, cannot be in a scene."""
    from renderer.statistics import measure  # noqa: PLC0415  (numpy, for which --help does not wait)
    from renderer.suggestion import suggest  # noqa: PLC0415
    from renderer.unseen import unseen_value  # noqa: PLC0415

    require_colormap(colormap)
    read = read_as_told(volume)
    require_proportion(volume_problems(extent_of(read), read.name))
    statistics = measure(read.values, read.source)
    suggestion = suggest(read, statistics, colormap)
    value = unseen_value(read, statistics) if hides_nonfinite and read.num_nonfinite else None
    if value is not None:
        hidden = replace(volume, nonfinite=value)
        with_value = read_as_told(hidden)
        other = suggest(with_value, measure(with_value.values, with_value.source), colormap)
        # That is another volume, in which the value may show against all expectation.
        if not _shows(with_value, other) or _shows(read, suggestion):
            volume, read, suggestion = hidden, with_value, other
    nonfinite = _fate(read, volume, suggestion) if read.num_nonfinite else None
    text = scene_text(
        volume,
        suggestion,
        film,
        folder=scene.parent,
        output=output,
        is_float=read.values.dtype.kind == "f",
        nonfinite=nonfinite,
    )
    _check(text, scene)
    return SuggestedScene(text, suggestion.kind, suggestion.reason, nonfinite)


def _shows(volume: Volume, suggestion: Suggestion) -> bool:
    """Whether what NaN have become is seen."""
    import numpy as np  # noqa: PLC0415

    from renderer.transfer import make_transfer  # noqa: PLC0415

    transfer = make_transfer(suggestion.transfer, volume.finest_spacing)
    return bool(transfer.classify(np.array([volume.stand_in]))[1][0] > 0)


def _fate(volume: Volume, spec: VolumeSpec, suggestion: Suggestion) -> str:
    """What becomes of voxels that are no numbers."""
    name = f"{'the lowest value, ' if spec.nonfinite == 'lowest' else ''}{volume.stand_in:.7g}"
    seen = "which can be seen" if _shows(volume, suggestion) else "which is not seen"
    total = volume.values.size
    return f"{volume.num_nonfinite} of {total} voxels are NaN or infinite; they are drawn as {name}, {seen}"


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
