"""Read and change a folder of goldens: golden.json and its pictures, which change together or not at all.

A change is first written whole into the folder `golden.ready`, under a temporary name, and renamed: from then on, it
counts. Its files are then moved into place, and the folder is removed. After a kill, reading prefers files in
`golden.ready`, and the next change moves them first. So no kill leaves pictures that golden.json does not describe.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from hsplat_cli.compare.golden.record import GOLDEN_FILE, GOLDEN_RECORD, GOLDEN_RECORD_FILE, GoldenRecord
from hsplat_cli.compare.picture_file import file_content, is_picture
from renderer.errors import InputError
from renderer.film import bytes_digest, locked_files, sync_to_disk, translate_os_errors
from renderer.scene import first_few
from renderer.system import deferrable_interrupts

_READY = "golden.ready"
_MAKING = "golden.making"
# The digest of golden.json where there is none.
NO_DIGEST = "0" * 32


@dataclass(frozen=True)
class GoldenFolder:
    """A folder with the goldens of one scene. It need not exist."""

    path: Path

    def find(self) -> GoldenRecord | None:
        """Return the content of golden.json; None without it. Raises InputError, and SceneError for mistakes in it."""
        place = self._place(GOLDEN_RECORD_FILE)
        return GOLDEN_RECORD.read(place) if os.path.lexists(place) else None

    @property
    def digest(self) -> str:
        """Return the digest of golden.json, NO_DIGEST without it. It changes whenever a golden changes."""
        place = self._place(GOLDEN_RECORD_FILE)
        if not os.path.lexists(place):
            return NO_DIGEST
        return bytes_digest(file_content(place, GOLDEN_RECORD.max_bytes, GOLDEN_RECORD.noun))

    def file(self, name: str) -> Path:
        """Return the path of a golden's file, which may be missing."""
        return self._place(name)

    def unlisted(self, record: GoldenRecord) -> list[str]:
        """Return the pictures in the folder that golden.json does not list.

        Raises InputError if one of them has the name of a golden: golden.json is older than it.
        """
        listed = _files(record)
        with translate_os_errors(self.path):
            names = {each.name for each in self.path.iterdir() if is_picture(each.name)}
        others = sorted(names - listed)
        lost = list(filter(GOLDEN_FILE.fullmatch, others))
        if lost and not (self.path / _READY).is_dir():  # a change that was not finished has not removed them yet
            raise InputError(
                f"{GOLDEN_RECORD_FILE} does not list all goldens in this folder",
                where=str(self.path),
                got=first_few(lost),
                hint=f"restore {GOLDEN_RECORD_FILE}, or move pictures that are not golden elsewhere",
            )
        return others

    def change(self, record: GoldenRecord, contents: Mapping[str, bytes]) -> None:
        """Replace golden.json and some pictures, and remove pictures that golden.json then does not list.

        contents: the content of each new or changed picture, by its file name. A kill at any moment leaves the goldens
        as they were, or as they are wanted. Raises InputError or RenderError if they cannot be written.
        """
        with translate_os_errors(self.path):
            self.path.mkdir(parents=True, exist_ok=True)
        with locked_files([self.path / GOLDEN_RECORD_FILE]):
            self._finish()
            making, ready = self.path / _MAKING, self.path / _READY
            with translate_os_errors(making):
                shutil.rmtree(making, ignore_errors=True)
                making.mkdir()
                for name, content in {**contents, GOLDEN_RECORD_FILE: GOLDEN_RECORD.content(record)}.items():
                    _write(making / name, content)
                making.rename(ready)
            with deferrable_interrupts() as defer_interrupts:
                defer_interrupts()
                self._finish()

    def _finish(self) -> None:
        """Finish a change that counts: remove what it does not list, and move its files into place.

        golden.json comes last, so that after another kill it still tells what is to be removed.
        """
        ready = self.path / _READY
        if not ready.is_dir():
            return
        before, after = self.path / GOLDEN_RECORD_FILE, ready / GOLDEN_RECORD_FILE
        with translate_os_errors(ready):
            if os.path.lexists(after) and os.path.lexists(before):
                for name in _files(GOLDEN_RECORD.read(before)) - _files(GOLDEN_RECORD.read(after)):
                    (self.path / name).unlink(missing_ok=True)
            names = sorted(each.name for each in ready.iterdir())
            for name in sorted(names, key=lambda name: name == GOLDEN_RECORD_FILE):
                os.replace(ready / name, self.path / name)
            ready.rmdir()

    def _place(self, name: str) -> Path:
        ready = self.path / _READY / name
        return ready if os.path.lexists(ready) else self.path / name


def _files(record: GoldenRecord) -> set[str]:
    return {picture.file for golden in record.frames for picture in golden.pictures if picture.file is not None}


def _write(path: Path, content: bytes) -> None:
    with path.open("xb") as file:
        file.write(content)
        file.flush()
        sync_to_disk(file.fileno())
