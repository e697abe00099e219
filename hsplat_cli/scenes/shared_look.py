"""Gives volumes the look of a scene: all of the scene except for its volume, framing and names of outputs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hsplat_cli.scenes.scene_text import SCENE_HINT, place_in, volume_place
from hsplat_cli.scenes.volume_arguments import read_with_options
from hsplat_cli.scenes.volume_names import own_name
from hsplat_cli.terminal import Reporter
from renderer.errors import InputError, Problem, SceneError
from renderer.scene import (
    FRAME_FIELD,
    FilmScene,
    FlightPath,
    LayerSpec,
    OutputFile,
    OutputSpec,
    OverFrames,
    PathSequence,
    TreeEditor,
    VolumeSpec,
    dump_yaml,
    edit_scene_content,
    file_source,
    is_pattern,
    map_values,
    may_be_json,
    missing_file_error,
    moving_result,
    output_suffix,
    outputs_of,
    raise_problems,
    read_content,
    spec_to_dict,
    with_files,
)
from renderer.system import printable

if TYPE_CHECKING:
    from renderer.statistics import ValueLine

# Keys of a scene's volume that say where its voxels are, and their size.
_SOURCE_KEYS = ("file", "raw", "procedural", "spacing")


@dataclass(frozen=True)
class SharedLook:
    """Holds a scene whose look is given to other volumes.

    path, content: the scene's file and its content. reference: a volume that the scene's values belong to, if the
    values are shifted and scaled to each other volume by comparing histograms; else None.
    """

    path: Path
    content: bytes
    reference: Path | str | None

    @classmethod
    def load(cls, path: Path, reference: Path | str | None) -> SharedLook:
        """Read a look. Raises InputError, and SceneError with all mistakes that would concern every volume."""
        look = cls(path, read_content(path), reference)
        if may_be_json(look.content):
            hint = "the YAML file of the scene, such as that beside a film of turntable"
            raise InputError("not a scene", where=str(path), expected=hint)
        if isinstance(reference, Path) and not reference.exists():
            raise missing_file_error(reference)
        raise_problems(look._editor.located_problems(look._problems()))
        return look

    @cached_property
    def scene(self) -> FilmScene:
        """Return the scene. The path of its volume is a placeholder: the path of the scene's file, which exists."""
        return self._editor.parse()

    @property
    def _editor(self) -> TreeEditor:
        """Return an editor of the scene without its volume and its framing, so that each volume gets its own."""
        editor = edit_scene_content(self.content, self.path)
        tree = editor.tree.data
        for entry in _own_entries(tree):
            others = {key: value for key, value in entry.items() if key not in _SOURCE_KEYS}
            entry.clear()
            entry.update({"file": self.path.name, **others})
        if isinstance(camera := tree.get("camera"), dict):
            camera.pop("distance", None)
            camera["target"] = "visible"
        return editor

    def _problems(self) -> Iterator[Problem]:
        """Yield a problem for each reason why other volumes cannot have this look, or cannot be matched with it."""
        scene = self.scene.at(0)
        path, first = scene.camera.path, scene.layers[0]
        if any(isinstance(piece, FlightPath) for piece in (path.pieces if isinstance(path, PathSequence) else [path])):
            expected, hint = "turntable, rocker, keyframes or hold", "its places belong to one volume"
            yield Problem("camera.path", "a flight cannot frame other volumes", "", expected, hint)
        if self.reference is None:
            return
        transfer, place = first.transfer_function, partial(self.scene.layer_key, 0)
        has_gradients = first.shading is not None and isinstance(first.shading.gradient_opacity, tuple)
        has_several = first.volume.component == "all" or len(_own_entries(self._editor.tree.data)) > 1
        refused = {
            place("labels"): transfer.labels is not None,
            f"{place('transfer_function')}.relative": transfer.relative,
            place("component"): first.volume.has_colors or has_several,
            f"{place('shading')}.gradient_opacity": has_gradients,
            "mode": scene.mode.type == "attenuation",
        }
        for key in filter(refused.__getitem__, refused):
            expected = "a transfer function with values of one component, and nothing else that has values"
            yield Problem(key, "cannot be matched with other volumes", "", expected, "leave out --match")

    def outputs(self, folder: Path, name: str) -> OutputSpec:
        """Return the outputs of the film `name` in a folder.

        The film NAME gets NAME.mp4, and NAME_OTHER.png for a further output OTHER.png of the scene.
        """
        first, *others = self.scene.output.files
        file = folder / f"{name}{'/{frame:04}' * first.is_numbered}{output_suffix(first.file)}"
        moved = [replace(each, file=folder / f"{name}_{_own_name(each)}") for each in others]
        return replace(self.scene.output, file=file, others=tuple(moved))

    @contextmanager
    def located(self) -> Iterator[None]:
        """Make SceneErrors raised in this context, about the scene of a volume, name lines of the look's scene."""
        try:
            yield
        except SceneError as error:
            raise SceneError(self._editor.located_problems(error.problems)) from None

    def scene_text(self, volume: VolumeSpec, scene: Path, reporter: Reporter) -> tuple[str, list[str]]:
        """Return the scene of a volume as YAML for the file `scene`, and notes on the scene; print the notes.

        Raises InputError where a volume cannot be matched.
        """
        tree, name, notes = self._editor.tree.data, printable(own_name(volume_place(volume))), list[str]()
        tree = with_files(tree, partial(_place_from, scene.parent, self.path.parent))
        plain, own = spec_to_dict(volume), _given(volume)
        section = plain.get("raw", plain)
        section["file"] = place_in(scene.parent, section["file"])
        for entry in _own_entries(tree):
            others = {key: value for key, value in entry.items() if key != "file"}
            entry.clear()
            entry.update({key: plain[key] for key in _SOURCE_KEYS if key in plain} | others)
            entry.update({key: plain[key] for key in own})
        if self.reference is not None:
            own_volume = replace(self.scene.at(0).layers[0].volume, source=volume.source, **own)
            line = self._match(own_volume, reporter)
            notes.append(f"values of {name} are values of {printable(own_name(self.reference))} {line}")
            reporter.status(notes[0])
            _map_layer(_own_entries(tree)[0] if "volumes" in tree else tree, self.scene.film_layers[0], line)
        for output, file in zip(outputs_of(tree), self.outputs(scene.parent, scene.stem).files, strict=True):
            output["file"] = str(file.file)
        about = [f"A film of {name} with the look of {printable(self.path.name)}.", *notes, SCENE_HINT]
        return "\n".join([*(f"# {line}" for line in about), dump_yaml(tree)]), notes

    def _match(self, volume: VolumeSpec, reporter: Reporter) -> ValueLine:
        """Return the linear map from values of the reference to values of a volume.

        Of a volume with steps in time, the first step is matched.
        """
        from renderer.statistics import match_values

        assert self.reference is not None
        own = replace(self.scene.at(0).layers[0].volume, source=file_source(self.reference))
        firsts = (replace(each, time=0) if each.time == "auto" else each for each in (own, volume))
        reference, scan = (read_with_options(each, replace(reporter, is_quiet=True)) for each in firsts)
        return match_values(reference, scan)


def _own_entries(tree: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the sections on a scene's first volume: one, or the entries of a list with the first entry's file."""
    volumes = tree.get("volumes")
    if not isinstance(volumes, list):
        section = tree.get("volume")
        tree["volume"] = section if isinstance(section, dict) else {}
        return [tree["volume"]]
    entries = [each for each in volumes if isinstance(each, dict)]
    return [each for each in entries if all(each.get(key) == entries[0].get(key) for key in _SOURCE_KEYS)]


def _own_name(output: OutputFile) -> str:
    """Return the name of an output's file; for frames named by numbers alone, with the name of their folder."""
    stem = FRAME_FIELD.sub("", output.file.stem)
    return output.file.name if stem else f"{output.file.parent.name}/{output.file.name}"


def _given(volume: VolumeSpec) -> dict[str, Any]:
    """Return the keys of a volume, except for its source, whose values differ from the defaults, with these values."""
    plain = VolumeSpec(volume.source)
    return {key: value for key, value in vars(volume).items() if value != getattr(plain, key)}


def _place_from(folder: Path, base: Path, key: str, name: str) -> str:
    """Return how a scene in `folder` names a file that a scene in `base` calls `name`.

    A name that belongs to no file, such as a preset's, is unchanged. key: the key of the name in the scene.
    """
    file, is_preset = base / name, key == "import" and not Path(name).suffix
    return place_in(folder, str(file)) if not is_preset and (file.exists() or is_pattern(file)) else name


def _map_layer(section: dict[str, Any], layer: OverFrames[LayerSpec], line: ValueLine) -> None:
    """Apply a linear map to the values in a layer's section of a scene: its transfer function or its colour's range."""
    if layer.at(0).color is None:
        mapped = layer.map(lambda each: map_values(each.transfer_function, line))
        section["transfer_function"] = spec_to_dict(mapped)
    else:
        section["range"] = spec_to_dict(layer.map(lambda each: _with_mapped_range(each, line)))["range"]


def _with_mapped_range(layer: LayerSpec, line: ValueLine) -> LayerSpec:
    return replace(layer, range=moving_result(lambda ends: tuple(map(line, ends)), layer.range))
