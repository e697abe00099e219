"""Choose the importer of a file with looks, and the look that a scene names in the file; read hsplat's own presets."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from renderer.errors import InputError, closest_match
from renderer.looks import fsleyes, imagej, inviwo, mricrogl, niivue, paraview, slicer, voreen
from renderer.looks.color_tables import labels_look
from renderer.looks.label_tables import LABEL_FORMATS, LabelReader, Sign, any_content
from renderer.looks.look import MAX_LOOK_POINTS, Look, Looks
from renderer.looks.look_file import LookFile

# A function that reads the look or the looks in a file.
Importer = Callable[[LookFile], Look | Looks]


def _labels_look(read: LabelReader, file: LookFile) -> Look:
    labels = read(file)
    if not any(label.color for label in labels):
        raise file.error("no colours", expected="a colour for each label")
    return labels_look(labels)


# The formats of files with looks, each with its suffix, the test of its content, its description for errors, and its
# importer. The first format whose suffix and test fit a file reads it.
_IMPORTERS: tuple[tuple[str, Sign, str, Importer], ...] = (
    (".json", re.compile(rb'"volumeProperties"').search, "a volume property of 3D Slicer", slicer.read_json),
    (
        ".json",
        re.compile(rb'"R"\s*:').search,
        "a colormap of niivue: an object with lists R, G, B, A and I",
        niivue.read,
    ),
    (".json", any_content, "colormaps of ParaView: a list of objects with Name and RGBPoints", paraview.read),
    (".xml", any_content, "presets of 3D Slicer: elements VolumeProperty", slicer.read_xml),
    (".vp", any_content, "a volume property of 3D Slicer: nine lines", slicer.read_text),
    (".tfi", any_content, "a transfer function of Voreen: TransFuncIntensity with Keys", voreen.read),
    (".itf", any_content, "a transfer function of Inviwo: Points with pos and rgba", inviwo.read),
    (".clut", any_content, "a colour table of MRIcroGL: numnodes, min, max, nodes", mricrogl.read),
    (".cmap", any_content, "a colormap of FSLeyes: rows of red, green and blue", fsleyes.read),
    *((suffix, sign, kind, partial(_labels_look, labels)) for suffix, sign, kind, labels in LABEL_FORMATS),
    (".lut", any_content, "a look-up table of ImageJ: 768 bytes, or rows of red, green and blue", imagej.read),
)
# An error lists at most this many names of looks.
_MAX_LISTED = 12


def read_look(path: Path, content: bytes, name: str | None) -> Look:
    """Return the look of a file. name: the name of the look, for a file with several looks.

    path: the path of the file, whose suffix tells the format. content: the bytes of the file. Raises InputError for a
    file without a valid look, LookNameError for a name that is unknown or missing.
    """
    for suffix, sign, kind, read in _IMPORTERS:
        if path.name.lower().endswith(suffix) and sign(content):
            file = LookFile(path, content, kind)
            look = _choose(read(file), name, str(path))
            if len(look.curve) > MAX_LOOK_POINTS:
                raise file.error("too many points", got=len(look.curve), expected=f"at most {MAX_LOOK_POINTS}")
            return look
    suffixes = ", ".join(dict.fromkeys(suffix for suffix, *_ in _IMPORTERS))
    raise InputError("not a kind of transfer function that is known", where=str(path), expected=f"a file {suffixes}")


def _choose(found: Look | Looks, name: str | None, where: str) -> Look:
    looks = {"": lambda: found} if isinstance(found, Look) else found
    names = [each for each in looks if each]
    if name is None and len(looks) == 1:
        return next(iter(looks.values()))()
    if name in names:
        return looks[name]()
    listed = ", ".join(names[:_MAX_LISTED]) + f" and {len(names) - _MAX_LISTED} more" * (len(names) > _MAX_LISTED)
    close = closest_match(name or "", names)
    raise LookNameError(
        "has several transfer functions" if name is None else "no transfer function of this name",
        where=where,
        got=name,
        expected=f"one of {listed}" if names else "no name, for there is one only",
        hint=f"did you mean {close}?" if close else "`name` picks one" if name is None else None,
    )


class LookNameError(InputError):
    """An error: no look of a file has the name that is given, or no name is given for a file with several looks."""


def read_preset(name: str) -> Look:
    """Return one of hsplat's own presets. Raises LookNameError for an unknown name."""
    import yaml

    presets = yaml.safe_load(Path(__file__).with_name("presets.yaml").read_text("utf-8"))
    return _choose({each: partial(_preset, found) for each, found in presets.items()}, name, "the presets")


def _preset(found: Mapping[str, Any]) -> Look:
    curve = [(float(value), (*(part / 255 for part in bytes.fromhex(color)), float(opacity)))
             for value, color, opacity in found["points"]]  # fmt: skip
    return Look(curve, found.get("is_share", False), unit=found.get("unit"), shading=found.get("shading", {}))
