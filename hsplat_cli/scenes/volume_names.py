"""Finds the volumes that a command line names, and names their films."""

from __future__ import annotations

import contextlib
import os
import re
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from urllib.parse import urlsplit

from renderer.errors import InputError
from renderer.job import expand_pattern, header_data_files
from renderer.readers import series_of_slice, volumes_in
from renderer.scene import join_some, path_or_url

# Matches the ending of a volume's name that the name of its film leaves out: of scan.v2.nii.gz only .nii.gz.
_ENDINGS = re.compile(
    r"\.(nii|img|hdr|nrrd|nhdr|m(h[ad]|g[hz]|rcs?|ap|at)|ccp4|rec|raw|tiff?|np[yz]|cube?|dcm|vt[kir]|pvd|pvti|h(df)?5|nc4?|ims|zarr|ome\.zarr|ozx|n5)"
    r"(\.gz|\.bz2|\.zip)?$",
    re.IGNORECASE,
)


def base_name(volume: Path | str) -> str:
    """Return the name of a volume's film: the volume's name without its ending, safe as a file name.

    volume: a path, or a text that is the URL of a store.
    """
    return _safe(_ENDINGS.sub("", own_name(volume)))


def own_name(volume: Path | str) -> str:
    """Return the name of a file or a folder, also for `scan/`, `.` and `..`, or the last part of a URL's path."""
    path = _path_of(volume)
    return path.name if isinstance(volume, str) or path.name not in ("", "..") else path.resolve().name


def _path_of(volume: Path | str) -> Path:
    """Return the path of a volume; of a URL, the server followed by the path there."""
    if isinstance(volume, Path):
        return volume
    parts = urlsplit(volume)
    return Path("/", parts.netloc, parts.path.strip("/"))


def _safe(name: str) -> str:
    """Return a name with `_` in place of control characters and of the syntax of templates, paths and options."""
    text = "".join("_" if char in "{}/\\" or not char.isprintable() else char for char in name)
    text = re.sub(r"^[-.]+", "_", text).strip()
    return text or "volume"


def expand_volumes(arguments: Sequence[str]) -> tuple[list[Path | str], list[str]]:
    """Return the volumes, each once, in the order given, and notes about volumes that are left out.

    Expands patterns that the shell has left, in sorted order, and folders of several volumes, to any depth. Leaves out
    data files whose headers are among the volumes, and replaces single slices of a DICOM series by their folder. An
    argument that cannot be read, such as a pattern that matches nothing, stays, and is an error when its film is made.
    So does a URL, which is not opened here.
    """
    found: dict[Path, Path | str] = {}
    others: dict[Path, list[Path]] = {}  # files of a folder of volumes that belong to no volume, by folder
    for text in arguments:
        if isinstance(place := path_or_url(text), str):
            found.setdefault(Path(text), place)
            continue
        try:
            paths = expand_pattern(text)
        except InputError:
            paths = [Path(text)]
        for path in paths:
            inside = _volumes_in(path)
            for each in inside or [path]:
                found.setdefault(_real(each), each)
            taken = {part for each in inside for part in (each, *each.parents)}
            others |= {path: sorted({*path.iterdir()} - taken)} if inside else {}
    found, joined = _join_slices(found)
    data = {
        file: head
        for key, head in found.items()
        if isinstance(head, Path)
        for file in header_data_files(head)
        if file != key
    }
    notes = [*joined, *(f"{path} is the data of {data[key]}" for key, path in found.items() if key in data)]
    for folder, entries in others.items():
        unused = [each for each in entries if _real(each) not in data and _real(each) not in found]
        names = [each.name for each in unused if not each.name.startswith(".")]
        if names:
            notes.append(f"{folder}: its volumes are drawn; left out: {join_some(names)}")
    return [path for key, path in found.items() if key not in data], notes


def _real(path: Path) -> Path:
    """Return the path with links replaced by their targets; a link that leads to itself is no error, and stays."""
    return Path(os.path.realpath(path))


def _volumes_in(path: Path) -> list[Path]:
    """Return the volumes in a folder of several volumes; none for another path, and for an unreadable folder."""
    if path.is_dir():
        with contextlib.suppress(InputError, OSError):
            return volumes_in(path)
    return []


def _join_slices(found: dict[Path, Path | str]) -> tuple[dict[Path, Path | str], list[str]]:
    """Return the volumes with the folder in place of single slices of one DICOM series, and a note on each folder."""
    slices: dict[tuple[Path, str], list[Path]] = {}
    for key, path in found.items():
        with contextlib.suppress(InputError, OSError):
            if isinstance(path, Path) and path.is_file() and (series := series_of_slice(path)) is not None:
                slices.setdefault((path.parent, series), []).append(key)
    joined = {key: folder for (folder, _), keys in slices.items() if len(keys) > 1 for key in keys}
    volumes: dict[Path, Path | str] = {}
    for key, path in found.items():
        folder = joined.get(key)
        volumes.setdefault(key if folder is None else _real(folder), path if folder is None else folder)
    counts = Counter(joined.values()).items()
    return volumes, [f"{num} files of {folder} are slices of one volume: the folder is drawn" for folder, num in counts]


def name_volumes(volumes: Sequence[Path | str]) -> dict[str, Path | str]:
    """Return the volumes by the names of their films; the names are unique, also on systems that ignore case.

    A name is `scan`. Where several volumes would have this name, each gets its folder, `a_scan`, or else its ending,
    `scan.nrrd`, or both, or two folders, or a number.
    """
    alike: dict[str, list[Path | str]] = {}
    for volume in volumes:
        alike.setdefault(base_name(volume).lower(), []).append(volume)
    form = {base: _distinguishing_form(group) for base, group in alike.items()}
    result: dict[str, Path | str] = {}
    for volume in volumes:
        name = wanted = form[base_name(volume).lower()](volume)
        number = 1
        while name.lower() in map(str.lower, result):
            number += 1
            name = f"{wanted}-{number}"
        result[name] = volume
    return result


def _distinguishing_form(group: Sequence[Path | str]) -> Callable[[Path | str], str]:
    """Return the first function from a volume to a name that gives each of these volumes a name of its own."""
    forms: list[Callable[[Path | str], str]] = [
        base_name,
        lambda volume: _safe(f"{_path_of(volume).absolute().parent.name}_{base_name(volume)}"),
        lambda volume: _safe(own_name(volume)),
        lambda volume: _safe(f"{_path_of(volume).absolute().parent.name}_{_safe(own_name(volume))}"),
        lambda volume: _safe("_".join([*_path_of(volume).absolute().parts[-3:-1], base_name(volume)])),
    ]
    return next((form for form in forms if len({form(volume).lower() for volume in group}) == len(group)), forms[1])
