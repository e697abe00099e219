"""Messages of `hsplat check` about a wrong scene file, and about options that make a scene wrong."""

from __future__ import annotations

from pathlib import Path

import pytest
from transcripts import Case, cases

# Files that are no scenes.
FILES = {
    "empty.yaml": b"# only a comment\n",
    "list.yaml": b"- a\n- {b: 0.50}\n",
    "latin_1.yaml": b"version: 1\noutput: {file: caf\xe9.mp4}\n",
    "utf_16.yaml": b"\xff\xfe" + "version: 1\n".encode("utf-16-le"),
    "volume.nrrd": bytes(300) + b"\xff",
    "header.nhdr": b"NRRD0004\n# made by hand\ntype: uint8\ndimension: 3\nsizes: 8 7 6\nencoding: raw\n",
    "header.mhd": b"NDims = 3\r\nDimSize = 8 7 6\r\nElementType = MET_UCHAR\r\nElementDataFile = v.raw\r\n",
    "control_character.yaml": b"version: 1\nvolume: {file: a\x07b}\n",
    "no_such_character.yaml": b'version: "\\UFFFFFFFF"\n',
    "presets.xml": b'<MRML><VolumeProperty name="bone" scalarOpacity="4 0 0 9 1" colorTransfer="4 5 1 1 1"/>\n'
    b'<VolumeProperty name="broken" scalarOpacity="4 0 0 9 1.5" colorTransfer="4 5 1 1 1"/></MRML>',
    **{f"step_{number:04}.nrrd": b"" for number in (0, 1, 3)},
    "steps.pvd": b"<VTKFile><Collection><DataSet file='../scan.nrrd'/></Collection></VTKFile>",
    "colors.cmap": b"0 0 1\n1 1 0\n",
    "too_large.yaml": b"#" * (2**20 + 1),
    "too_deep.yaml": b"[" * 5000,
    "anchor_in_itself.yaml": b"a: &a [*a]\n",
    "billion_laughs.yaml": b"a: &a [x, x, x, x, x, x, x, x, x, x]\n"
    + b"".join(b"%c: &%c [%s]\n" % (i + 1, i + 1, b", ".join([b"*%c" % i] * 10)) for i in b"abcdefgh"),
}


@cases("scene.txt")
def test_messages(case: Case, scene_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, content in FILES.items():
        (scene_folder / name).write_bytes(content)
    case.check(capsys)
