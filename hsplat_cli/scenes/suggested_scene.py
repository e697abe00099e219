"""Suggests a scene, as text, that shows a volume."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from hsplat_cli.scenes.scene_text import FilmOptions, scene_text
from hsplat_cli.scenes.volume_arguments import read_with_options
from hsplat_cli.terminal import Reporter
from renderer.errors import InputError, SceneError
from renderer.scene import (
    VolumeSpec,
    format_value,
    is_colormap,
    nearest_colormap,
    parse_scene_content,
)

# The option that each value of a scene came from.
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
    and what becomes of them; None where all are. outlier_notes: as in `renderer.suggest.suggestion.Suggestion`."""

    text: str
    kind: str
    reason: str
    nonfinite: str | None = None
    outlier_notes: tuple[str, ...] = ()

    def summary_lines(self) -> list[str]:
        """Return what there is to say about the volume, one line each."""
        return [
            f"{self.kind}; {self.reason}",
            *self.outlier_notes,
            *([] if self.nonfinite is None else [self.nonfinite]),
        ]


def require_colormap(name: str | None) -> None:
    """Raise InputError for a colormap that does not exist."""
    if name is not None and not is_colormap(name):
        close = nearest_colormap(name)
        raise InputError(
            "unknown colormap",
            where="--colormap",
            got=format_value(name),
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
    """Return a scene for the file `scene`.

    hides_nonfinite: where `volume` has the `lowest` value for NaN and infinities, and another value is less visible,
    use that. Raises InputError for a volume that cannot be read or drawn, and SceneError for an option, such as the
    background, that cannot be in a scene.
    """
    require_colormap(colormap)
    from renderer.suggest import suggest_for

    found = suggest_for(
        volume, lambda spec: read_with_options(spec, reporter), colormap=colormap, hides_nonfinite=hides_nonfinite
    )
    text = scene_text(
        found.volume,
        found.suggestion,
        film,
        folder=scene.parent,
        output=output,
        is_float=found.is_float,
        nonfinite=found.nonfinite,
    )
    _check(text, scene)
    chosen = found.suggestion
    return SuggestedScene(text, chosen.kind, chosen.reason, found.nonfinite, chosen.outlier_notes)


def _check(text: str, scene: Path) -> None:
    """Raise SceneError, with the options, for values that cannot be in a scene, such as odd sizes of an MP4.

    Nothing is written yet, so no line can be shown.
    """
    try:
        parse_scene_content(text.encode(), scene, overrides=(), volume=None, output=None, is_single_frame=False)
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
