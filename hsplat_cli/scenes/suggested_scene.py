"""A volume to the text of a scene that shows it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from hsplat_cli.scenes.scene_text import FilmOptions, scene_text
from hsplat_cli.scenes.volume_arguments import read_with_options
from hsplat_cli.terminal import Reporter
from renderer.errors import InputError, SceneError
from renderer.scene import (
    VolumeSpec,
    extent_of,
    is_colormap,
    nearest_colormap,
    parse_scene_content,
    raise_problems,
    show,
    volume_problems,
)

if TYPE_CHECKING:
    from renderer.suggest import Suggestion

# Where the values of a scene came from.
_OPTIONS = {
    "volume.spacing": "--spacing",
    "volume.raw.spacing": "--spacing",
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
    and what becomes of them; None where all are. far: as in `renderer.suggest.suggestion.Suggestion`."""

    text: str
    kind: str
    reason: str
    nonfinite: str | None = None
    far: tuple[str, ...] = ()

    def summary_lines(self) -> list[str]:
        """What is said about the volume, a line each."""
        return [f"{self.kind}; {self.reason}", *self.far, *([] if self.nonfinite is None else [self.nonfinite])]


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
    reporter: Reporter,
    *,
    colormap: str | None,
    scene: Path,
    output: Path,
    hides_nonfinite: bool = False,
) -> SuggestedScene:
    """The scene to be written to the file `scene`.

    hides_nonfinite: where `volume` asks for the `lowest` value in the places of NaN and infinities, and another one is
    better hidden, they get that.

    Raises InputError for a volume that cannot be read or drawn, and SceneError where an option, such as the background,
    cannot be in a scene.
    """
    require_colormap(colormap)
    tried = _attempt(volume, colormap, reporter)
    if hides_nonfinite and tried.unseen is not None:
        other = _attempt(replace(volume, nonfinite=tried.unseen), colormap, reporter)
        # That is another volume, in which the value may show against all expectation.
        if tried.shows or not other.shows:
            tried = other
    text = scene_text(
        tried.volume,
        tried.suggestion,
        film,
        folder=scene.parent,
        output=output,
        is_float=tried.is_float,
        nonfinite=tried.nonfinite,
    )
    _check(text, scene)
    chosen = tried.suggestion
    return SuggestedScene(text, chosen.kind, chosen.reason, tried.nonfinite, chosen.far)


@dataclass(frozen=True)
class _Attempt:
    """What comes of a volume, whose voxels are in memory no longer.

    unseen: the value to try for NaN and infinities, or None. shows: whether what they are now is seen. nonfinite: as in
    SuggestedScene.
    """

    volume: VolumeSpec
    suggestion: Suggestion
    is_float: bool
    unseen: float | None = None
    shows: bool = False
    nonfinite: str | None = None


def _attempt(volume: VolumeSpec, colormap: str | None, reporter: Reporter) -> _Attempt:
    import numpy as np

    from renderer.suggest import measure, suggest, suggest_nonfinite_fill
    from renderer.transfer import make_transfer_function

    read = read_with_options(volume, reporter)
    raise_problems(volume_problems(extent_of(read), read.name))
    statistics = measure(read.values, read.source)
    tried = _Attempt(volume, suggest(read, statistics, colormap), read.values.dtype.kind == "f")
    if not read.num_nonfinite:
        return tried
    is_lowest = volume.nonfinite == "lowest"
    transfer = make_transfer_function(tried.suggestion.transfer, read.finest_spacing)
    shows = bool(transfer.classify(np.array([read.stand_in]))[1][0] > 0)
    told = (
        f"{read.num_nonfinite} of {read.values.size} voxels are NaN or infinite; they are drawn as "
        f"{'the lowest value, ' if is_lowest else ''}{read.stand_in:.7g}, which "
        f"{'can be seen' if shows else 'is not seen'}"
    )
    unseen = suggest_nonfinite_fill(read, statistics) if is_lowest else None
    return replace(tried, unseen=unseen, shows=shows, nonfinite=told)


def _check(text: str, scene: Path) -> None:
    """Raise SceneError for values that cannot be in a scene, such as odd sizes of an MP4, with the options that they
    came from. Nothing has been written yet, so that there is no line to show."""
    try:
        parse_scene_content(text.encode(), scene, overrides=(), volume=None, output=None, still=False)
    except SceneError as error:
        raise SceneError(
            [
                replace(
                    problem,
                    what=problem.what.partition("\n")[0],
                    location=_OPTIONS.get(problem.path, "the scene that was suggested"),
                )
                for problem in error.problems
            ]
        ) from error
