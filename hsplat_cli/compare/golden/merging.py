"""Merge new pictures into the goldens of a scene: in place of those that it has, or beside them."""

from __future__ import annotations

from dataclasses import replace

from hsplat_cli.compare.golden.golden_folder import Content
from hsplat_cli.compare.golden.project import GoldenScene, SceneRules
from hsplat_cli.compare.golden.record import (
    MOST_PICTURES,
    Golden,
    GoldenPicture,
    GoldenRecord,
    Origin,
    golden_file_name,
)
from renderer.errors import InputError


def keeps_files(rules: SceneRules, before: GoldenRecord | None) -> bool:
    """Return whether goldens are kept as files: by the rules, else as they are kept so far."""
    if rules.pictures is not None:
        return rules.pictures == "files"
    return before is None or bool(before.files)


class GoldenMerger:
    """Merges new pictures, all of one origin, into the goldens of a scene.

    goldens: the goldens, by frame. contents: functions that return the content of each new file, by its name.
    """

    def __init__(
        self, scene: GoldenScene, before: GoldenRecord | None, origin: Origin, num_frames: int, *, also: bool
    ) -> None:
        """Begin with the content of golden.json; None without one.

        num_frames: of the scene. also: whether new pictures become further goldens beside those that a frame has.
        """
        self.goldens = {**before.by_frame} if before else {}
        self.contents = dict[str, Content]()
        self._origins = [*before.origins] if before else []
        if origin not in self._origins:
            self._origins.append(origin)
        self._origin = self._origins.index(origin)
        self._folder, self._keeps_files = scene.folder, keeps_files(scene.rules, before)
        self._num_frames, self._also = num_frames, also

    def merge(self, frame: int, digest: str, psnr: float | None, content: Content) -> None:
        """Make a picture golden. One that is golden already stays, and its file is written if it was lost.

        Raises InputError if the frame would have too many goldens.
        """
        golden = self.goldens.get(frame, Golden(frame, ()))
        picture = next((each for each in golden.pictures if each.digest == digest), None)
        if picture is None:
            picture = GoldenPicture(digest, self._origin, None, psnr)
            golden = Golden(frame, (*(golden.pictures if self._also else ()), picture))
        if len(golden.pictures) > MOST_PICTURES:
            raise InputError(f"frame {frame} has {MOST_PICTURES} goldens, the most that it can have", where="--also")
        if not self._keeps_files:
            pictures = [replace(each, file=None) for each in golden.pictures]
        elif picture.file is not None and self._folder.holds(picture):
            pictures = [*golden.pictures]
        else:
            name = picture.file or golden_file_name(frame, self._num_frames, golden.free_number)
            pictures = [replace(each, file=name) if each is picture else each for each in golden.pictures]
            self.contents[name] = content
        self.goldens[frame] = Golden(frame, tuple(pictures))

    def record(self, selection: str, flicker: float | None) -> GoldenRecord:
        """Return the new content of golden.json, without the origins that no picture has."""
        goldens = [golden for _, golden in sorted(self.goldens.items())]
        used = sorted({picture.origin for golden in goldens for picture in golden.pictures})
        numbers = {origin: number for number, origin in enumerate(used)}

        def renumbered(golden: Golden) -> Golden:
            pictures = [replace(picture, origin=numbers[picture.origin]) for picture in golden.pictures]
            return replace(golden, pictures=tuple(pictures))

        origins = tuple(self._origins[number] for number in used)
        return GoldenRecord(origins, tuple(map(renumbered, goldens)), selection, flicker)
