"""Say for a paper how a film was made, from its record alone: a paragraph on methods, and BibTeX."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from renderer.errors import Problem
from renderer.record.accuracy_records import accuracy_text, file_accuracy_text
from renderer.record.film_record import FilmAccuracy, FilmRecord, VolumeRecord
from renderer.record.goals import range_text
from renderer.scene import (
    SECTIONS,
    OutputSpec,
    Scene,
    counted,
    join_words,
    raise_problems,
    schedule_to_dict,
    schema,
    short_text,
)

# The sections of settings that are read from a recorded scene and from each of its volumes. They name no files that
# must still exist.
_SECTIONS = {key: SECTIONS[key] for key in ("splat", "mode", "shading", "light", "output")}
_LIGHT = {
    "specular": "highlights", "silhouette": "silhouettes", "occlusion": "ambient occlusion", "shadow": "soft shadows",
    "gradient_opacity": "opacities that depend on the gradient",
}  # fmt: skip
# Of each goal, the words for its value; the second gap is for ` a frame` in a film of several frames.
_GOALS = {"splats": "at most {} cells{}", "seconds": "{} s{}", "psnr": "PSNR {} dB", "rmse": "RMSE {}"}
# The version of a package, or a commit, as it may be printed. Other characters may have a meaning in BibTeX.
_VERSION = re.compile(r"[\w.+ -]{1,80}", re.ASCII)
_DIGITS_OF_FINGERPRINT = 12


def bibtex(record: FilmRecord) -> str:
    """Return BibTeX entries for the paper on hierarchical splatting, and for the version of hsplat that made a film."""
    return Path(__file__).with_name("citation.bib").read_text("utf-8").replace("VERSION", _version(record))


def _version(record: FilmRecord) -> str:
    version = record.versions.get("hsplat", "")
    return version if _VERSION.fullmatch(version) else "unknown"


def methods_text(record: FilmRecord, sidecar: Path) -> str:
    """Return a paragraph on the volume, the method and the measured accuracy of a film.

    Raises SceneError for a record whose scene has mistakes.
    """
    volumes = {f"scene.volumes.{k}": each for k, each in enumerate(record.scene.get("volumes", ()))}
    read = [_read_sections(tree, place, sidecar) for place, tree in {"scene": record.scene, **volumes}.items()]
    output, num = read[0]["output"], len(record.frames)
    sentences = [
        f"{'A picture' if num == 1 else counted(num, 'frame')} of {output.size[0]} x {output.size[1]} pixels "
        f"{'was' if num == 1 else 'were'} rendered with hsplat (version {_version(record)}) by hierarchical splatting "
        "(Laur and Hanrahan 1991).",
        f"The {'volumes were' if record.volumes else 'volume was'} "
        f"{'; '.join(map(_volume_text, record.volumes or (record.volume,)))}.",
        _drawing_sentence(record, read[0]),
        _light_sentence([each["shading"] for each in read if "shading" in each], read[0].get("light")),
        *([] if record.accuracy is None else _accuracy_sentences(record.accuracy, record, output)),
    ]
    return " ".join(sentences)


def _read_sections(tree: Mapping[str, Any], place: str, sidecar: Path) -> dict[str, Any]:
    problems: list[Problem] = []
    written = {key: value for key, value in tree.items() if key in _SECTIONS}
    node = schema.TreeNode(written, place, problems, film=schema.FilmTime(None, 1.0))
    given = schema.read_fields(node, _SECTIONS)
    raise_problems(replace(problem, location=str(sidecar)) for problem in problems)
    return given


def _volume_text(volume: VolumeRecord) -> str:
    """Return a line on a volume: `engine.nhdr, 256 x 256 x 110 voxels of uint8, spacing 1 x 1 x 1.4 mm, fingerprint
    c50eea700b5c`.
    """
    x, y, z, _ = (math.hypot(*column) for column in zip(*volume.world_from_index[:3], strict=True))
    return (
        f"{volume.name}, {' x '.join(map(str, volume.shape))} voxels of {volume.dtype}, spacing "
        f"{x:.6g} x {y:.6g} x {z:.6g} {volume.unit or 'world units'}, "
        f"fingerprint {volume.fingerprint[:_DIGITS_OF_FINGERPRINT]}"
    )


def _drawing_sentence(record: FilmRecord, given: Mapping[str, Any]) -> str:
    requested, splat, mode = record.schedule.requested, given.get("splat", Scene.splat), given.get("mode", Scene.mode)
    goals = {key: short_text(value) for key, value in schedule_to_dict(requested).items() if key in _GOALS}
    each, begin = ("", "An") if len(record.frames) == 1 else (" a frame", "For each frame, an")
    why = "".join(f"; chosen for {_GOALS[key].format(value, each)}" for key, value in goals.items())
    drawn = f"splats with a {splat.footprint.title()} footprint, blended by depth"
    if splat.footprint == "integrated":
        shown = f"show the {mode.type}" if mode.is_projection else "integrate emission and absorption"
        drawn = f"bricks, which {shown} along each ray"
    return (
        f"{begin} octree of averages was cut at tolerance {range_text(record.schedule.tolerance)} "
        f"({requested.measure} error of a cell{why}), and its cells were drawn as {drawn}."
    )


def _light_sentence(shadings: list[Any], light: Any) -> str:
    """Return a sentence on the light of a film.

    shadings: the `shading` sections of the scene and its volumes. light: the `light` of the scene; None without one.
    """
    if light is not None:
        sources = "an environment" if light.key is None else "an environment and a key light"
        how = "equally in all directions, any number of times"
        return f"Matter scattered the light of {sources} {how}."
    words = [word for key, word in _LIGHT.items() if any(getattr(each, key) not in (None, 0) for each in shadings)]
    return f"There was {join_words(['Lambertian shading', *words], 'and') if shadings else 'no shading'}."


def _accuracy_sentences(accuracy: FilmAccuracy, record: FilmRecord, output: OutputSpec) -> Iterator[str]:
    """Yield a sentence on the accuracy of the film, and one for each further file that shows the measured pictures."""
    is_still, decoded = len(record.frames) == 1, ""
    if accuracy.file:
        part = "the picture" if is_still else f"the first {counted(accuracy.file.frames, 'frame')}"
        decoded = f" and {part} decoded again"
    truth, probes = "the exact ray integral", "exact rays through"
    if "light" in record.scene:
        truth, probes = "the light of paths by Monte Carlo", "pixels of"
    probes += " the picture" if is_still else " all frames"
    yield (
        f"Accuracy of {output.file.name} against {truth}: {accuracy_text(accuracy)}; intervals of 95 %, by "
        f"{accuracy.rays} {probes}{decoded}."
    )
    for file, other in zip(output.others, record.outputs, strict=False):
        if file.kind == output.kind and (file.is_frames or other.psnr_of_encoding is not None):
            yield f"Of {file.file.name}: {file_accuracy_text(accuracy, other.psnr_of_encoding)}."
