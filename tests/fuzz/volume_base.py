"""An undamaged volume that is to be damaged, and how one is made of its files."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from renderer.scene import RawSource
from renderer.volume import Array

Ranges = tuple[tuple[int, int], ...]


@dataclass(frozen=True, eq=False)
class Base:
    """An undamaged volume.

    name: its format and what is special about it, such as `nrrd gzip`. files: by their names below a folder.
    opened: the name of the file that is opened, or of the folder of slices. choice: `time` and `component`.
    values: its voxels, [z, y, x], where they are known. guarded: the bytes of each file that a checksum covers.
    headers: the bytes of each file that are no voxels, as far as that is known.
    pack: compresses the damaged content of the only file, which is `unpacked` when it is not damaged.
    raw: the declaration of a file without a header.
    """

    name: str
    files: dict[str, bytes]
    opened: str
    choice: dict[str, int] = field(default_factory=dict)
    values: Array | None = None
    guarded: dict[str, Ranges] = field(default_factory=dict)
    headers: dict[str, Ranges] = field(default_factory=dict)
    pack: Callable[[bytes], bytes] | None = None
    unpacked: bytes = b""
    raw: dict[str, Any] | None = None

    @property
    def form(self) -> str:
        """Return the name of the format alone."""
        return self.name.split(" ", maxsplit=1)[0]

    @property
    def is_text(self) -> bool:
        """Return whether voxels are written as numbers of text, whose end may be any digit."""
        return any(word in self.name.split() for word in ("text", "hex", "ascii", "cube"))

    def source(self, folder: Path) -> RawSource | None:
        """Return the declaration of a file without a header; None for files that have one."""
        return None if self.raw is None else RawSource(file=folder / self.opened, **self.raw)


def written(write: Callable[[Path], None]) -> dict[str, bytes]:
    """Return the files that a function writes into an empty folder."""
    with tempfile.TemporaryDirectory(prefix="hsplat-fuzz-") as name:
        folder = Path(name)
        write(folder)
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def behind(mark: bytes, data: bytes) -> int:
    return data.index(mark) + len(mark)


def attached(name: str, files: dict[str, bytes], mark: bytes, *, guarded: bool, **more: Any) -> Base:
    """Return a volume in one file, whose voxels begin behind a mark."""
    ((opened, data),) = files.items()
    begin = data.index(b"\n", behind(mark, data) - 1) + 1
    spans = {opened: ((begin, len(data)),)} if guarded else {}
    return Base(name, files, opened, guarded=spans, headers={opened: ((0, begin),)}, **more)


def detached(name: str, files: dict[str, bytes], header: str, *, guarded: bool, **more: Any) -> Base:
    """Return a volume whose header is a file of its own."""
    spans = {other: ((0, len(data)),) for other, data in files.items() if other != header} if guarded else {}
    return Base(name, files, header, guarded=spans, headers={header: ((0, len(files[header])),)}, **more)


def sample_values(dtype: str = "uint16", shape: tuple[int, ...] = (4, 12, 10)) -> Array:
    """Return voxels that compress a little: a ramp and some noise."""
    noise = np.random.default_rng(7).integers(0, 40, shape)
    ramp = sum(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"))
    return (noise + 3 * np.asarray(ramp)).astype(dtype)
