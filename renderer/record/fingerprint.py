"""Compute the fingerprint of a film: all data that its frames depend on, and the settings of their encoding.

It has the accuracy that was requested, not the tolerances that were found for it. A film is therefore up to date both
for its scene and for its sidecar, which has these tolerances, whichever of the two made it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from renderer.film import file_digest
from renderer.record.film_record import FilmFingerprint
from renderer.record.up_to_date import Fingerprint, program_versions
from renderer.scene import (
    ErrorSpec,
    FilmScene,
    OutputSpec,
    first_output,
    outputs_of,
    scene_to_dict,
    schedule_to_dict,
    spec_to_dict,
    with_draw_order,
    with_files,
    without_sources,
)

# The keys of the scene's section `output` on which frames depend. Its other keys are about the encoding and the name
# of the film.
_DRAWN_KEYS = ("size", "background", "dpi")
_NOT_ENCODED = ("file",)


def film_fingerprint(scene: FilmScene, requested: ErrorSpec, volume_fingerprint: str, device: str) -> FilmFingerprint:
    """Return the fingerprint of a film, which depends on scene, voxels, versions of packages and device.

    requested: the requested accuracy. It counts in place of the tolerances that were found for it, so that a film that
        is rendered from its sidecar has the same fingerprint.
    volume_fingerprint: the joint fingerprint of the film's volumes. device: the device that draws.
    """
    tree = without_sources(scene_to_dict(with_draw_order(scene)))
    tree = with_files(tree, lambda _, name: Path(name).name)  # files of fonts and logos may be moved
    left_out = {*schedule_to_dict(scene.error), "probes"}
    rest = {key: value for key, value in tree["error"].items() if key not in left_out}
    first_file = first_output(tree)
    output = {key: first_file[key] for key in _DRAWN_KEYS if key in first_file}
    shown: dict[str, Any] = {}
    first = scene.at(0)
    if first.annotation.has_patches:
        # The object is framed beside the annotation of all files, whose texts have a smallest size.
        shown |= {"sizes": [list(each.size) for each in scene.output.others]} if scene.output.others else {}
        shown |= {"units": [layer.volume.unit for layer in first.layers]}
        shown |= {"files of annotation": [file_digest(file) for file in first.annotation.files]}
    depends_on = {
        "scene": tree | {"output": output, "error": {**schedule_to_dict(requested), **rest}} | shown,
        "volume": {"fingerprint": volume_fingerprint},
        **program_versions(),
        "device": device,
    }
    return fingerprint_of(depends_on, scene.output)


def fingerprint_of(depends_on: Mapping[str, Any], output: OutputSpec) -> FilmFingerprint:
    """Return the fingerprint of a film whose frames depend on this plain data.

    output: the outputs of the film, whose settings of the encoding the fingerprint has, too.
    """
    tree = outputs_of({"output": spec_to_dict(output)})
    first, *others = ({key: value for key, value in each.items() if key not in _NOT_ENCODED} for each in tree)
    first = {key: value for key, value in first.items() if key not in _DRAWN_KEYS}
    encoding = json.loads(json.dumps({"output": [first, *others] if others else first}))
    of_frames = Fingerprint.of(**depends_on)
    return FilmFingerprint(of_frames.digest, encoding, of_frames.depends_on)
