"""Whole messages about the volume."""

from __future__ import annotations

from collections.abc import Callable

import pytest

# What is replaced in the scene, by what, and what is said about it.
CASES = {
    "two_sources": (
        "  procedural:",
        """\
  raw: {file: walnut.raw, shape: [2, 2, 2], dtype: uint16}
  procedural:\
""",
        """\
scene.yaml:4:3: volume.procedural: contradicts volume.raw
    | procedural: {name: engine_block, shape: [64, 64, 32]}
    | ^
  expected: one source of voxels
""",
    ),
    "no_source": (
        "  procedural: {name: engine_block, shape: [64, 64, 32]}",
        "  nonfinite: lowest",
        """\
scene.yaml:2:1: volume: no voxels
    | volume:
    | ^
  expected: one of file, raw and procedural
""",
    ),
    "spacing_beside_procedural": (
        "  procedural:",
        """\
  spacing: [1, 1, 2]
  procedural:\
""",
        """\
scene.yaml:3:3: volume.spacing: a procedural volume has its own spacing
    | spacing: [1, 1, 2]
    | ^
  hint: give volume.procedural.spacing instead
""",
    ),
    "spacing_of_a_file": (
        "procedural: {name: engine_block, shape: [64, 64, 32]}",
        "file: scan.nrrd\n  spacing: [1, 0, 1e31]",
        """\
scene.yaml:4:16: volume.spacing.1: out of range
    | spacing: [1, 0, 1e31]
    |              ^
  got: 0
  expected: a number from 1e-30 to 1e+30
scene.yaml:4:19: volume.spacing.2: out of range
    | spacing: [1, 0, 1e31]
    |                 ^
  got: 1e+31
  expected: a number from 1e-30 to 1e+30
""",
    ),
    "flat_voxels_of_a_file": (
        "procedural: {name: engine_block, shape: [64, 64, 32]}",
        "file: scan.nrrd\n  spacing: [1, 1, 1e6]",
        """\
scene.yaml:4:12: volume.spacing: the voxels are too long or too flat
    | spacing: [1, 1, 1e6]
    |          ^
  got: sides with a ratio of 1e+06
  expected: a longest side of at most 1e+05 times the shortest
""",
    ),
    "missing_file": (
        "procedural: {name: engine_block, shape: [64, 64, 32]}",
        "file: scan.nrd",
        """\
scene.yaml:3:9: volume.file: no such file
    | file: scan.nrd
    |       ^
  got: /scans/scan.nrd
  expected: an NRRD, MetaImage, NIfTI, TIFF or .npy file, or a folder of DICOM or TIFF slices
  hint: did you mean scan.nrrd?
""",
    ),
    "raw_size": (
        "procedural: {name: engine_block, shape: [64, 64, 32]}",
        "raw: {file: scan.nrrd, shape: [2, 2, 2], dtype: uint16}",
        """\
scene.yaml:3:15: volume.raw.file: wrong size
    | raw: {file: scan.nrrd, shape: [2, 2, 2], dtype: uint16}
    |             ^
  got: 30 bytes
  expected: 16 bytes: 2 x 2 x 2 voxels of uint16
  hint: if the file begins with a header, set offset: 14
""",
    ),
    "headerless": (
        "procedural: {name: engine_block, shape: [64, 64, 32]}",
        "file: walnut.raw",
        """\
scene.yaml:3:9: volume.file: a file without a header
    | file: walnut.raw
    |       ^
  got: /scans/walnut.raw
  expected: an NRRD, MetaImage, NIfTI, TIFF or .npy file, or a folder of DICOM or TIFF slices
  hint: give volume.raw: {file: ..., shape: [...], dtype: ...} instead
""",
    ),
    "dtype": (
        "procedural: {name: engine_block, shape: [64, 64, 32]}",
        "raw: {file: walnut.raw, shape: [2, 2, 2], dtype: ushort}",
        """\
scene.yaml:3:52: volume.raw.dtype: unknown value
    | raw: {file: walnut.raw, shape: [2, 2, 2], dtype: ushort}
    |                                                  ^
  got: 'ushort'
  expected: uint8, int8, uint16, int16, uint32, int32, uint64, int64, float16, float32 or float64
  hint: did you mean uint16?
""",
    ),
    "nonfinite": (
        "  procedural",
        """\
  nonfinite: lowst
  procedural\
""",
        """\
scene.yaml:3:14: volume.nonfinite: unknown value
    | nonfinite: lowst
    |            ^
  got: 'lowst'
  expected: error, lowest or a finite number
  hint: did you mean lowest?
""",
    ),
    "nonfinite_itself": (
        "  procedural",
        """\
  nonfinite: .nan
  procedural\
""",
        """\
scene.yaml:3:14: volume.nonfinite: unknown value
    | nonfinite: .nan
    |            ^
  got: .nan
  expected: error, lowest or a finite number
""",
    ),
    "crop_outside": (
        "  procedural",
        """\
  crop: [[0, 65], [8, 8], [0, 32]]
  procedural\
""",
        """\
scene.yaml:3:10: volume.crop.0: outside the volume
    | crop: [[0, 65], [8, 8], [0, 32]]
    |        ^
  got: [0, 65]
  expected: an end of at most 64
scene.yaml:3:19: volume.crop.1: an empty range
    | crop: [[0, 65], [8, 8], [0, 32]]
    |                 ^
  got: [8, 8]
  expected: [first, end] with first less than end
""",
    ),
    "time_of_procedural": (
        "  procedural",
        """\
  time: 0
  procedural\
""",
        """\
scene.yaml:3:3: volume.time: a procedural volume has neither time steps nor components
    | time: 0
    | ^
  hint: remove the key
""",
    ),
    "too_many_voxels": (
        "[64, 64, 32]",
        "[65536, 65536, 65536]",
        """\
scene.yaml:3:43: volume.procedural.shape: too many voxels
    | procedural: {name: engine_block, shape: [65536, 65536, 65536]}
    |                                         ^
  got: 281474976710656
  expected: at most 68719476736 (4096 x 4096 x 4096)
""",
    ),
}


@pytest.mark.parametrize(("old", "new", "message"), CASES.values(), ids=CASES)
def test_message(complaint: Callable[[str, str], str], old: str, new: str, message: str) -> None:
    assert complaint(old, new) + "\n" == message
