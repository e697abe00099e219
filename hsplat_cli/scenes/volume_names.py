"""Names of volumes on a command line: which files are meant, and what their films are called."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from hsplat_cli.scenes.patterns import expand_pattern
from renderer.errors import InputError
from renderer.film import header_data_files

# Endings of volumes; of a name such as scan.v2.nii.gz the last one only is taken away.
_ENDINGS = re.compile(r"\.(nii|img|hdr|nrrd|nhdr|mha|mhd|raw|tiff?|npy|dcm|vtk|mrc)(\.gz|\.bz2)?$", re.IGNORECASE)


@dataclass(frozen=True)
class NamedVolume:
    """A volume, and the name of its scene and film."""

    volume: Path
    name: str


def base_name(volume: Path) -> str:
    """What the film of a volume is called: its name without its ending, safe as the name of a file."""
    return _safe(_ENDINGS.sub("", _own_name(volume)))


def _own_name(volume: Path) -> str:
    """`scan` for `scan/`, `.` or `..`, too."""
    return volume.name if volume.name not in ("", "..") else volume.resolve().name


def _safe(name: str) -> str:
    """Without control characters, and without what a template or a command line would take for its own."""
    text = "".join("_" if char in "{}/\\" or not (char == " " or char.isprintable()) else char for char in name)
    text = re.sub(r"^[-.]+", "_", text).strip()
    return text or "volume"


def expand_volumes(arguments: Sequence[str]) -> tuple[list[Path], list[str]]:
    """The volumes that are meant, each once, in the order given, and what is to be said about those left out.

    A pattern that the shell did not expand is expanded here, sorted. Data files are left out where their headers are
    among the volumes. A pattern that matches nothing is a volume that is not there, which is said when its turn comes.
    Raises InputError for the slices of a DICOM series one by one.
    """
    found: dict[Path, Path] = {}
    for text in arguments:
        try:
            paths = expand_pattern(text)
        except InputError:
            paths = [Path(text)]
        for path in paths:
            found.setdefault(path.resolve(), path)
    _refuse_slices(list(found.values()))
    data = {file: head for key, head in found.items() for file in header_data_files(head) if file != key}
    notes = [f"{path} is the data of {data[key]}" for key, path in found.items() if key in data]
    return [path for key, path in found.items() if key not in data], notes


def _refuse_slices(volumes: Sequence[Path]) -> None:
    folders = Counter(path.parent for path in volumes if path.suffix.lower() == ".dcm" and path.is_file())
    for folder, num in folders.items():
        if num > 1:
            raise InputError(
                f"{num} DICOM files of one folder would be a film each",
                where=str(folder),
                hint="name the folder: its files are the slices of one volume",
            )


def name_volumes(volumes: Sequence[Path]) -> list[NamedVolume]:
    """Each volume with a name of its own, also where upper and lower case are the same.

    `scan`; where there are several of them, with the folder `a_scan`, or else with the ending `scan.nrrd`, or else with
    a number.
    """
    alike: dict[str, list[Path]] = {}
    for volume in volumes:
        alike.setdefault(base_name(volume).lower(), []).append(volume)
    form = {base: _distinguishing_form(group) for base, group in alike.items()}
    taken: set[str] = set()
    result = []
    for volume in volumes:
        name = wanted = form[base_name(volume).lower()](volume)
        number = 1
        while name.lower() in taken:
            number += 1
            name = f"{wanted}-{number}"
        taken.add(name.lower())
        result.append(NamedVolume(volume, name))
    return result


def _distinguishing_form(group: Sequence[Path]) -> Callable[[Path], str]:
    """The first way to name volumes that tells these apart."""
    forms = (base_name, _with_folder, _with_ending, _with_both)
    return next((form for form in forms if len({form(volume).lower() for volume in group}) == len(group)), _with_folder)


def _with_folder(volume: Path) -> str:
    return _safe(f"{volume.absolute().parent.name}_{base_name(volume)}")


def _with_ending(volume: Path) -> str:
    return _safe(_own_name(volume))


def _with_both(volume: Path) -> str:
    return _safe(f"{volume.absolute().parent.name}_{_own_name(volume)}")
