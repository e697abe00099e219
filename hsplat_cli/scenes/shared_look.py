"""Give volumes the look of a scene: all of it but its volume, what frames that, and the names of its outputs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hsplat_cli.scenes.scene_text import SCENE_HINT, place_in, volume_file
from hsplat_cli.scenes.volume_arguments import read_with_options
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
    from renderer.suggest import ValueLine

# Keys that say where the voxels are.
_SOURCE_KEYS = ("file", "raw", "procedural", "spacing")


@dataclass(frozen=True)
class SharedLook:
    """A scene whose look other volumes have.

    content: of its file. reference: the volume whose values it has, if those of others are matched with them.
    """

    path: Path
    content: bytes
    reference: Path | None

    @classmethod
    def load(cls, path: Path, reference: Path | None) -> SharedLook:
        """Read a look. Raises InputError, and SceneError with all that is wrong with it for any volume."""
        look = cls(path, read_content(path), reference)
        if may_be_json(look.content):
            hint = "the YAML file of the scene, such as that beside a film of turntable"
            raise InputError("not a scene", where=str(path), expected=hint)
        if reference is not None and not reference.exists():
            raise missing_file_error(reference)
        raise_problems(look._editor.located_problems(look._problems()))
        return look

    @cached_property
    def scene(self) -> FilmScene:
        """Return the scene, with its own file, which is surely there, in the place of its volume."""
        return self._editor.parse()

    @property
    def _editor(self) -> TreeEditor:
        """Return an editor of that scene, in which each volume is framed on its own."""
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
        """Yield why a scene cannot be the look of other volumes, or its values not be matched."""
        scene = self.scene.at(0)
        path, first = scene.camera.path, scene.layers[0]
        if any(isinstance(piece, FlightPath) for piece in (path.pieces if isinstance(path, PathSequence) else [path])):
            expected, hint = "turntable, rocker, keyframes or hold", "its places are those of one volume"
            yield Problem("camera.path", "a flight cannot frame other volumes", "", expected, hint)
        if self.reference is None:
            return
        transfer, place = first.transfer_function, "volumes.0." if self.scene.has_list else ""
        has_several = first.volume.component == "all" or len(_own_entries(self._editor.tree.data)) > 1
        refused = {
            f"{place}labels": transfer.labels is not None,
            f"{place}transfer_function.relative": transfer.relative,
            f"{place or 'volume.'}component": first.volume.has_colors or has_several,
            "shading.gradient_opacity": first.shading is not None and isinstance(first.shading.gradient_opacity, tuple),
            "mode": scene.mode.type == "attenuation",
        }
        for key in filter(refused.__getitem__, refused):
            expected = "a transfer function with values of one component, and nothing else that has values"
            yield Problem(key, "cannot be matched with other volumes", "", expected, "leave out --match")

    def outputs(self, folder: Path, name: str) -> OutputSpec:
        """Return the outputs of the film of this name: NAME.mp4, and further ones with their own names, too."""
        first, *others = self.scene.output.files
        file = folder / f"{name}{'/{frame:04}' * first.is_numbered}{output_suffix(first.file)}"
        moved = [replace(each, file=folder / f"{name}_{_own_name(each)}") for each in others]
        return replace(self.scene.output, file=file, others=tuple(moved))

    @contextmanager
    def located(self) -> Iterator[None]:
        """Say of problems with the scene of a volume where they are in this one."""
        try:
            yield
        except SceneError as error:
            raise SceneError(self._editor.located_problems(error.problems)) from None

    def scene_text(self, volume: VolumeSpec, scene: Path, reporter: Reporter) -> tuple[str, list[str]]:
        """Return the scene of a volume as YAML for the file `scene`, and notes on it, which are printed.

        Raises InputError where a volume cannot be matched.
        """
        tree, name, notes = self._editor.tree.data, printable(volume_file(volume).name), list[str]()
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
            notes.append(f"values of {name} are those of {printable(self.reference.name)} {line}")
            reporter.status(notes[0])
            _map_layer(_own_entries(tree)[0] if "volumes" in tree else tree, self.scene.film_layers[0], line)
        for output, file in zip(outputs_of(tree), self.outputs(scene.parent, scene.stem).files, strict=True):
            output["file"] = str(file.file)
        about = [f"A film of {name} with the look of {printable(self.path.name)}.", *notes, SCENE_HINT]
        return "\n".join([*(f"# {line}" for line in about), dump_yaml(tree)]), notes

    def _match(self, volume: VolumeSpec, reporter: Reporter) -> ValueLine:
        """Return how values of the reference become those of a volume; of steps in time those of the first."""
        from renderer.suggest import match_values

        assert self.reference is not None
        own = replace(self.scene.at(0).layers[0].volume, source=file_source(self.reference))
        firsts = (replace(each, time=0) if each.time == "auto" else each for each in (own, volume))
        reference, scan = (read_with_options(each, replace(reporter, is_quiet=True)) for each in firsts)
        return match_values(reference, scan)


def _own_entries(tree: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what a scene says of its volume; in a list of volumes the first one, and components of the same file."""
    volumes = tree.get("volumes")
    if not isinstance(volumes, list):
        section = tree.get("volume")
        tree["volume"] = section if isinstance(section, dict) else {}
        return [tree["volume"]]
    entries = [each for each in volumes if isinstance(each, dict)]
    return [each for each in entries if all(each.get(key) == entries[0].get(key) for key in _SOURCE_KEYS)]


def _own_name(output: OutputFile) -> str:
    """Return the name of an output, of numbered frames without a name that of their folder with theirs."""
    stem = FRAME_FIELD.sub("", output.file.stem)
    return output.file.name if stem else f"{output.file.parent.name}/{output.file.name}"


def _given(volume: VolumeSpec) -> dict[str, Any]:
    """Return what options say of a volume besides its source."""
    plain = VolumeSpec(volume.source)
    return {key: value for key, value in vars(volume).items() if value != getattr(plain, key)}


def _place_from(folder: Path, base: Path, key: str, name: str) -> str:
    """Return the name of a file for a scene in another folder, if there is one. base: the folder that it is from."""
    file, is_preset = base / name, key == "import" and not Path(name).suffix
    return place_in(folder, str(file)) if not is_preset and (file.exists() or is_pattern(file)) else name


def _map_layer(section: dict[str, Any], layer: OverFrames[LayerSpec], line: ValueLine) -> None:
    """Map the values of a layer in its section of a scene, which has a transfer function, or a colour and a range."""
    if layer.at(0).color is None:
        mapped = layer.map(lambda each: map_values(each.transfer_function, line))
        section["transfer_function"] = spec_to_dict(mapped)
    else:
        section["range"] = spec_to_dict(layer.map(lambda each: _with_mapped_range(each, line)))["range"]


def _with_mapped_range(layer: LayerSpec, line: ValueLine) -> LayerSpec:
    return replace(layer, range=moving_result(lambda ends: tuple(map(line, ends)), layer.range))
