"""Compare what two versions of hsplat read from the same files: voxels, place and notes.

    PYTHONPATH=old python tests/bench/readers.py read old.json FILE_OR_FOLDER...
    PYTHONPATH=. python tests/bench/readers.py read new.json FILE_OR_FOLDER...
    python tests/bench/readers.py compare old.json new.json

A folder stands for all files below it that are named like volumes, and for its folders of slices. Each is read as it
is, and with the first and the second time step and component. Formats that are read in a child process are read in this
one, which is quicker.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import json
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

SUFFIXES = (".nrrd", ".nhdr", ".mha", ".mhd", ".nii", ".nii.gz", ".hdr", ".tif", ".npy", ".dcm", ".vtk", ".cube")
CHOICES = ({}, {"time": 0, "component": 0}, {"time": 1}, {"component": 1})


def volumes(path: Path) -> Iterator[Path]:
    if path.is_file():
        yield path
        return
    for entry in [path, *sorted(path.rglob("*"))]:
        is_series = entry.is_dir() and any(each.suffix in (".dcm", ".tif") for each in entry.iterdir())
        if is_series or (entry.is_file() and entry.name.lower().endswith(SUFFIXES)):
            yield entry


class ThisProcess:
    """The host of a reader in this process."""

    def allocate(self, shape: tuple[int, ...], dtype: object) -> object:
        import numpy as np

        return np.zeros(shape, dtype)

    def expect_bytes(self, num_bytes: int) -> None:
        """This process has no limit."""

    def begin_file(self, path: Path) -> None:
        """No other process asks."""


def read_here() -> None:
    """Read all formats in this process; versions that have no child process do so anyway."""
    module = importlib.import_module("renderer.readers.read")

    with contextlib.suppress(ImportError):
        from renderer.readers.isolation import call_reader

        module.read_isolated = lambda reader, path, **rest: call_reader(reader, path, rest, ThisProcess())


def read(path: Path, choice: dict[str, int]) -> list[object]:
    import numpy as np

    from renderer.errors import InputError
    from renderer.readers import read_volume
    from renderer.scene import FileSource, VolumeSpec

    try:
        volume = read_volume(VolumeSpec(FileSource(path), nonfinite="lowest", **choice))
    except InputError as error:
        return ["refused", error.what]
    digest = hashlib.sha256(np.ascontiguousarray(volume.values).tobytes()).hexdigest()
    places = (np.round(volume.world_from_index[:3], 9) + 0.0).tolist()
    return ["read", volume.values.dtype.name, list(volume.values.shape), digest, places, volume.note]


def compare(old: dict[str, list[object]], new: dict[str, list[object]]) -> None:
    results: Counter[str] = Counter()
    for name, before in old.items():
        after = new[name]
        if before[0] != after[0]:
            results[f"{before[0]}, now {after[0]}: {before[1] if before[0] == 'refused' else after[1]}"] += 1
        elif before[0] == "refused":
            results["refused by both"] += 1
        else:
            parts = ("type", "shape", "voxels", "place", "note")
            changed = [part for part, a, b in zip(parts, before[1:], after[1:], strict=True) if a != b]
            results["read alike" if not changed else f"other {' and '.join(changed)}"] += 1
            if changed:
                print(name)
    for result, number in results.most_common():
        print(f"| {result} | {number} |")


def main() -> None:
    action, first, *rest = sys.argv[1:]
    if action == "compare":
        compare(json.loads(Path(first).read_text()), json.loads(Path(rest[0]).read_text()))
        return
    read_here()
    found = {
        f"{path.relative_to(root.parent)} {choice}": read(path, choice)
        for root in map(Path, rest)
        for path in volumes(root)
        for choice in CHOICES
    }
    Path(first).write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
