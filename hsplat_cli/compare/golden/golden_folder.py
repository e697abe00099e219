"""Read and change a folder of goldens: golden.json and its pictures, which change together or not at all.

A change is first written whole into the folder `golden.ready`, under a temporary name, and renamed: from then on, it
counts. Its files are then moved into place, and the folder is removed. After a kill, reading prefers files in
`golden.ready`, and the next change moves them first. So no kill leaves pictures that golden.json does not describe.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from hsplat_cli.compare.golden.record import (
    GOLDEN_FILE,
    GOLDEN_RECORD,
    GOLDEN_RECORD_FILE,
    GoldenPicture,
    GoldenRecord,
    picture_digest,
)
from hsplat_cli.compare.picture_file import is_picture, read_picture
from renderer.errors import InputError, SceneError
from renderer.film import Pixels, WrittenFiles, folder_files, locked_files, sync_to_disk, translate_os_errors
from renderer.scene import first_few
from renderer.system import deferrable_interrupts

_READY = "golden.ready"
_MAKING = "golden.making"

# Returns the content of a new file. The files of a large project do not fit into memory at once.
Content = Callable[[], bytes]


@dataclass(frozen=True)
class GoldenFolder:
    """A folder with the goldens of one scene. It need not exist."""

    path: Path

    def find(self) -> GoldenRecord | None:
        """Return the content of golden.json; None without it. Raises InputError, and SceneError for mistakes in it."""
        place = self.file(GOLDEN_RECORD_FILE)
        with _restorable(place, "remove the folder and draw the goldens again"):
            return GOLDEN_RECORD.read(place) if os.path.lexists(place) else None

    def file(self, name: str) -> Path:
        """Return the path of a file, which may be missing: that of a change that counts, if there is one."""
        ready = self._ready / name
        return ready if os.path.lexists(ready) else self.path / name

    def picture(self, name: str) -> Pixels:
        """Return the picture in the file of a golden. Raises InputError if it is damaged."""
        place = self.file(name)
        with _restorable(place, "draw it again by `hsplat golden --update`"):
            return read_picture(place)

    def holds(self, picture: GoldenPicture) -> bool:
        """Return whether the file of a golden is there as golden.json describes it; golden digests have no file."""
        if picture.file is None:
            return True
        try:
            return picture_digest(self.picture(picture.file)) == picture.digest
        except InputError:
            return False

    def shown_digest(self, picture: GoldenPicture) -> str:
        """Return the digest of the picture that a golden shows: of its file, or, without one, as golden.json has it.

        Raises InputError if the file is damaged.
        """
        if picture.file is None or not self.file(picture.file).exists():
            return picture.digest
        return picture_digest(self.picture(picture.file))

    def require_changeable(self, names: Iterable[str], inputs: Iterable[Path]) -> None:
        """Raise InputError or RenderError if files of these names cannot be written here, or are inputs of the scene.

        names: of all files that may be written or removed, beside golden.json.
        """
        files = [self.path / name for name in dict.fromkeys([*names, GOLDEN_RECORD_FILE])]
        WrittenFiles(files, [self.path / _READY, self.path / _MAKING]).require_harmless(inputs)
        with locked_files([self.path / GOLDEN_RECORD_FILE]):  # found before minutes of drawing
            pass

    def unlisted(self, record: GoldenRecord | None) -> list[str]:
        """Return the pictures in the folder that golden.json does not list. record: its content; None without one.

        Raises InputError if one of them has the name of a golden: golden.json is older than it.
        """
        names = {each.name for each in folder_files(self.path) if is_picture(each.name)}
        others = sorted(names - (record.files if record else set()))
        lost = list(filter(GOLDEN_FILE.fullmatch, others))
        if lost and not (self.path / _READY).is_dir():  # a change that was not finished has not removed them yet
            raise InputError(
                f"{GOLDEN_RECORD_FILE} does not list all goldens in this folder",
                where=str(self.path),
                got=first_few(lost),
                hint=f"restore {GOLDEN_RECORD_FILE}, or move pictures that are not golden elsewhere",
            )
        return others

    def finish(self) -> None:
        """Finish a change that counts, and whose program was killed."""
        if self._ready.is_dir():
            with locked_files([self.path / GOLDEN_RECORD_FILE]):
                self._finish()

    def change(self, before: GoldenRecord | None, after: GoldenRecord, contents: Mapping[str, Content]) -> None:
        """Replace golden.json and some pictures, and remove pictures that golden.json then does not list.

        before: the content of golden.json that the change was planned for. contents: the content of each new or changed
        picture, by its file name. A kill at any moment leaves the goldens as they were, or as they are wanted.
        Raises InputError if another program has changed the goldens, and InputError or RenderError if they cannot be
        written.
        """
        with locked_files([self.path / GOLDEN_RECORD_FILE]):
            self._finish()
            self._require(before)
            self._stage(after, contents)
            with deferrable_interrupts() as defer_interrupts:
                defer_interrupts()
                self._finish()

    def remove(self, before: GoldenRecord) -> None:
        """Remove golden.json and the pictures that it lists, and the folder, unless it has other files.

        before: the content of golden.json that the removal was planned for. golden.json goes last: after a kill, it
        still tells what is removed. Raises InputError if another program has changed the goldens.
        """
        with locked_files([self.path / GOLDEN_RECORD_FILE]):
            self._finish()
            self._require(before)
            with translate_os_errors(self.path):
                for name in [*before.files, GOLDEN_RECORD_FILE]:
                    (self.path / name).unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # other files are left in it
            self.path.rmdir()

    def _require(self, before: GoldenRecord | None) -> None:
        """Raise InputError unless golden.json has the content that a change was planned for."""
        if self.find() != before:
            hint = "run the command again"
            raise InputError("another program has changed these goldens", where=str(self.path), hint=hint)

    def _stage(self, record: GoldenRecord, contents: Mapping[str, Content]) -> None:
        """Write a change into the folder for changes that count."""
        making = self.path / _MAKING
        with translate_os_errors(making):
            shutil.rmtree(making, ignore_errors=True)
            making.mkdir()
            try:
                for name, content in contents.items():
                    _write(making / name, content())
                _write(making / GOLDEN_RECORD_FILE, GOLDEN_RECORD.content(record))
                making.rename(self._ready)
            except BaseException:
                shutil.rmtree(making, ignore_errors=True)
                raise

    def _finish(self) -> None:
        """Finish a change that counts: remove the pictures that it does not list, and move its files into place.

        The removals come first: after another kill, its golden.json still tells them.
        """
        ready = self._ready
        if not ready.is_dir():
            return
        before, after = self.path / GOLDEN_RECORD_FILE, ready / GOLDEN_RECORD_FILE
        with translate_os_errors(ready):
            if os.path.lexists(after) and os.path.lexists(before):
                for name in GOLDEN_RECORD.read(before).files - GOLDEN_RECORD.read(after).files:
                    (self.path / name).unlink(missing_ok=True)
            for name in sorted(each.name for each in ready.iterdir()):
                os.replace(ready / name, self.path / name)
            ready.rmdir()

    @property
    def _ready(self) -> Path:
        """Return the folder of a change that counts. Raises InputError for a link, whose files are not ours to move."""
        ready = self.path / _READY
        if ready.is_symlink():
            raise InputError("a link in a folder of goldens", where=str(ready), hint="remove it")
        return ready


@contextlib.contextmanager
def _restorable(path: Path, other: str) -> Iterator[None]:
    """Add a hint to the error of a damaged file. other: the remedy where the file is in no repository."""
    try:
        yield
    except InputError as error:
        if error.hint == GOLDEN_RECORD.hint or isinstance(error, SceneError):
            raise
        remedy = f"restore it by `git checkout -- {path}`, or {other}"
        hint = f"{error.hint}; {remedy}" if error.hint else remedy
        raise InputError(error.what, where=error.where, got=error.got, expected=error.expected, hint=hint) from error


def _write(path: Path, content: bytes) -> None:
    with path.open("xb") as file:
        file.write(content)
        file.flush()
        sync_to_disk(file.fileno())
