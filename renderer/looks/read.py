"""Choose the importer of a file, and the look in it that is asked for; read presets."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from renderer.errors import InputError, closest_match
from renderer.looks import fsleyes, imagej, inviwo, label_tables, mricrogl, niivue, paraview, slicer, voreen
from renderer.looks.look import MAX_LOOK_POINTS, Look, Looks
from renderer.looks.look_file import LookFile

Importer = Callable[[LookFile], Look | Looks]

# The importer for the end of a file's name, and for a pattern that its content has. The first that fits reads the file.
_IMPORTERS: tuple[tuple[str, bytes, Importer], ...] = (
    (".json", rb'"volumeProperties"', slicer.read_json),
    (".json", rb'"R"', niivue.read),
    (".json", b"", paraview.read),
    (".xml", b"", slicer.read_xml),
    (".vp", b"", slicer.read_text),
    (".tfi", b"", voreen.read),
    (".itf", b"", inviwo.read),
    (".clut", b"", mricrogl.read),
    (".cmap", b"", fsleyes.read),
    (".lut", rb"\A\d+[ \t]+[.\d]+[ \t]+[.\d]+[ \t]+[.\d]+[ \t]+\S", label_tables.read_fsleyes),
    (".lut", b"", imagej.read),
    (".ctbl", b"", label_tables.read_slicer),
    (".txt", rb'(?m)^[ \t]*\d+[ \t][^"\n]*"', label_tables.read_itk_snap),
    (".label", b"", label_tables.read_itk_snap),
    (".txt", b"", label_tables.read_freesurfer),
)
_MAX_LISTED = 12


def read_look(path: Path, content: bytes, name: str | None) -> Look:
    """Return the look of a file with this content. name: of one of several in it.

    Raises InputError with the place in the file, LookNameError for a name that is unknown or missing.
    """
    file = LookFile(path, content)
    suffixes = dict.fromkeys(suffix for suffix, _, _ in _IMPORTERS)
    for suffix, pattern, read in _IMPORTERS:
        if path.name.lower().endswith(suffix) and re.search(pattern, content):
            look = _choose(read(file), name, str(path))
            if len(look.curve) > MAX_LOOK_POINTS:
                raise file.error("too many points", got=len(look.curve), expected=f"at most {MAX_LOOK_POINTS}")
            return look
    raise file.error("not a kind of transfer function that is known", expected=f"a file {', '.join(suffixes)}")


def _choose(found: Look | Looks, name: str | None, where: str) -> Look:
    looks = {"": lambda: found} if isinstance(found, Look) else found
    names = [each for each in looks if each]
    if name is None and len(looks) == 1:
        return next(iter(looks.values()))()
    if name in names:
        return looks[name]()
    listed = ", ".join(names[:_MAX_LISTED]) + f" and {len(names) - _MAX_LISTED} more" * (len(names) > _MAX_LISTED)
    close = closest_match(name, names) if name else None
    raise LookNameError(
        "has several transfer functions" if name is None else "no transfer function of this name",
        where=where,
        got=name,
        expected=f"one of {listed}" if names else "no name, for there is one only",
        hint=f"did you mean {close}?" if close else "`name` picks one" if name is None else None,
    )


class LookNameError(InputError):
    """A name that a file lacks, or one that is needed."""


def read_preset(name: str) -> Look:
    """Return a preset of our own. Raises LookNameError for an unknown name."""
    import yaml

    presets = yaml.safe_load(Path(__file__).with_name("presets.yaml").read_text("utf-8"))
    return _choose({each: partial(_preset, found) for each, found in presets.items()}, name, "the presets")


def _preset(found: Mapping[str, Any]) -> Look:
    curve = [(float(value), (*(part / 255 for part in bytes.fromhex(color)), float(opacity)))
             for value, color, opacity in found["points"]]  # fmt: skip
    return Look(curve, found.get("is_share", False), unit=found.get("unit"), shading=found.get("shading", {}))
