"""Names and colours of labels: tables of other programs, their looks, tables beside a volume, and those in its file."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from this_process import read_here
from volume_files import NIBABEL, read, written

from renderer.errors import InputError
from renderer.looks import find_label_table, read_label_table, read_look
from renderer.volume import Label

RED, GREEN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
CLEAR = (0.0, 0.0, 0.0, 0.0)
ITK_SNAP = '# ITK-SnAP Label\n0 0 0 0 0 0 0 "Clear Label"\n2 255 0 0 0.5 1 1 "a"\n4 0 255 0 1 0 1 "b"\n'
FREESURFER = "#No. Label Name: R G B A\n\n0   Unknown  0 0 0 0\n2   a  255 0 0 0 # left\n4 b 0 255 0 255 7\n"
SLICER = FREESURFER.replace("  a  ", ' "a" ')
FSLEYES = "# a comment\n2 1.0 0. 0. a\n 4 0 1 0 b\n"
NIIVUE = '{"R": [0, 255, 0], "G": [0, 0, 255], "B": [0, 0, 0], "I": [0, 2, 4], "labels": []}'
TSV = 'index\tname\tmapping\tcolor\n2\ta\t\t#ff0000\n4\t"b"\tn/a\t#00FF00\n'
CSV = "LabelValue,Name,Color_R,Color_G,Color_B,Color_A\r\n2,a,255,0,0,51\r\n4,b,0,255,0,255\r\n"

# File, content, and the opacities of label 2, which is red and called a, and of label 4, which is green and called b.
COLORED: dict[str, tuple[str, str, tuple[float | None, float | None]]] = {
    "ITK-SNAP": ("a.txt", ITK_SNAP, (0.5, 0.0)),
    "ITK-SNAP, another suffix": ("a.label", ITK_SNAP, (0.5, 0.0)),
    "FreeSurfer, transparency": ("a.txt", FREESURFER, (1.0, 0.0)),
    "Slicer": ("a.ctbl", SLICER, (0.0, 1.0)),
    "Slicer, text": ("a.TXT", "# Color table file a.txt\n" + SLICER, (0.0, 1.0)),
    "Slicer, columns": ("a.csv", CSV, (0.2, 1.0)),
    "FSLeyes": ("a.lut", FSLEYES, (None, None)),
    "BIDS": ("a.tsv", TSV, (None, None)),
    "niivue": ("a.json", NIIVUE, (1.0, 1.0)),
}
# File, content, and all names by label; no colours.
NAMED: dict[str, tuple[str, str, dict[int, str]]] = {
    "names": ("a.txt", "# c\n1 Left  cortex\n20\tÄpfel 3\n3 7N_1\n", {1: "Left cortex", 3: "7N_1", 20: "Äpfel 3"}),
    "MRIcron": ("a.txt", "2\tFrontal_L\t2002\r\n1\tPrecentral_L\t2001\r\n", {1: "Precentral_L", 2: "Frontal_L"}),
    "quotes": ("a.csv", '\ufeff1,"Cortex, left"\n2,b\n', {1: "Cortex, left", 2: "b"}),
    "columns": ("a.csv", "Name,index,color\n\"a, b\",1,n/a\n,2\n", {1: "a, b", 2: ""}),
    "XCP-D": ("a.tsv", "index\tlabel\tx\n1\tVis_1\t\n", {1: "Vis_1"}),
    "a long name": ("a.txt", "1 " + "x" * 5000, {1: "x" * 200}),
}  # fmt: skip


def table(name: str, content: str | bytes) -> tuple[Label, ...]:
    return read_label_table(written(Path(name), content if isinstance(content, bytes) else content.encode()))


pytestmark = pytest.mark.usefixtures("folder")


@pytest.mark.parametrize("case", COLORED)
def test_a_table_has_names_and_colours_and_makes_a_look(case: str) -> None:
    name, content, opacities = COLORED[case]
    if case != "niivue":
        found = tuple(each for each in table(name, content) if each.value)
        assert found == (Label(2, "a", RED, opacities[0]), Label(4, "b", GREEN, opacities[1]))
    curve = [(-0.5, CLEAR), (0.5, CLEAR)]
    for value, color, opacity in zip((2, 4), (RED, GREEN), opacities, strict=True):
        shown = (*color, 1.0 if opacity is None else opacity)
        curve += [(value - 1.5, CLEAR), (value - 0.5, CLEAR), (value - 0.5, shown), (value + 0.5, shown)]
    look = read_look(Path(name), content.encode(), None)
    assert list(look.curve) == [*curve, (4.5, CLEAR)] and look.span == (0, 4)


@pytest.mark.parametrize("case", NAMED)
def test_a_table_may_have_names_alone(case: str) -> None:
    name, content, expected = NAMED[case]
    assert table(name, content) == tuple(Label(value, expected[value]) for value in sorted(expected))
    assert table("a.lut", bytes(range(256)) + bytes(512))[51] == Label(51, "", (0.2, 0.0, 0.0))  # colours alone


WRONG: dict[str, tuple[str, str | bytes, str]] = {
    "twice": ("a.txt", FREESURFER + "2 c 0 0 0 0\n",
              "a.txt:6: a label twice\n  got: 2\n  expected: each label once; it is in line 4"),
    "a colour in words": ("a.tsv", TSV.replace("#00FF00", "green"), "a.tsv:3: not a colour\n  got: 'green'"),
    "not whole": ("a.csv", "index,name\n1.5,a\n", "a.csv:2: not a label\n  got: '1.5'"),
    "no columns": ("a.csv", "x,y\n1,2\n", "a.csv:1: no column `index`"),
    "no rows": ("a.ctbl", "# nothing\n", "a.ctbl: no labels"),
    "numbers alone": ("a.txt", "0 0 0 0\n1 1 1 1\n", "a.txt:1: not a row"),
    "too many": ("a.txt", "".join(f"{k} a\n" for k in range(65537)), "a.txt:65537: too many labels"),
    "too large": ("a.txt", bytes(2**22 + 1), "too large for a table of labels"),
    "hostile blanks": ("a.txt", "1" + " " * 10**6 + "2" * 10**6, "a.txt:1: not a row"),
    "an unknown suffix": ("a.png", "1 a\n", "not a kind of table of labels"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_table_is_refused_with_its_place(case: str) -> None:
    name, content, expected = WRONG[case]
    with pytest.raises(InputError) as error:
        table(name, content)
    assert expected in str(error.value) and str(error.value).startswith(name)


@pytest.mark.parametrize(
    ("volume", "others", "expected"),
    [
        ("scan.nii.gz", ["scan.nii.txt", "scan_LUT.txt"], "scan_LUT.txt"),
        ("v1.2.seg.nrrd", ["v1.txt", "v1.2_ColorTable.ctbl"], "v1.2_ColorTable.ctbl"),
        ("sub-1_desc-a_dseg.nii.gz", ["desc-b_dseg.tsv", "../../desc-a_dseg.tsv"], "../../desc-a_dseg.tsv"),
        ("sub-1_desc-a_dseg.nii.gz", ["dseg.tsv", "sub-1_dseg.tsv"], "sub-1_dseg.tsv"),
        ("x" * 250 + ".nii", [], None),
    ],
)
def test_a_table_beside_a_volume_is_found(volume: str, others: list[str], expected: str | None) -> None:
    folder = Path("sub-1/anat")
    folder.mkdir(parents=True)
    (folder / "scan.ctbl").write_text("some text\n")  # passed over
    for name in others:
        (folder / name).write_text("index\tname\n1\ta\n" if name.endswith(".tsv") else "1 a 0 0 0 0\n")
    found = find_label_table(folder / volume)
    with pytest.raises(InputError, match="not a file"):
        read_label_table(folder)
    assert (found and found.resolve()) == (expected and (folder / expected).resolve())


@pytest.mark.real_data
def test_tables_as_fsleyes_ships_them(data_dir: Path) -> None:
    labels = read_label_table(data_dir / "transfer_functions/fsleyes_harvard-oxford-subcortical.lut")
    assert labels[0] == Label(1, "Left Cerebral White Matter", (0.80392, 0.24314, 0.30588))
    assert len(read_label_table(data_dir / "transfer_functions/fsleyes_mgh-cma-freesurfer.lut")) > 50


# Labels in a volume's file

VOXELS = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)


@pytest.mark.parametrize(
    ("lines", "component", "expected"),
    [
        ("Segment1_Name:=Ä b \nSegment1_LabelValue:=7\nSegment1_Color:=0 1 0\nSegment1_Layer:=1\n"
         "Segment0_Name:=a\nSegment0_LabelValue:=7\nSegment0_Layer:=0\n", 1, [Label(7, "Ä b", GREEN)]),
        ("Segment0_Name:=a\nSegment1_Name:=b\n", 1, [Label(1, "b")]),
        ("Segment0_Name:=a\n", 1, []),
        ("Segment0_LabelValue:=x\nSegment0_Layer:=0\n", None, "not such a number (a.seg.nrrd: Segment0)"),
        ("Segment0_Layer:=0\nSegment1_Layer:=0\n", 0, "a label twice (a.seg.nrrd: Segment1)"),
        ("Segment0_Color:=1 2 0\n", None, "not such a number (a.seg.nrrd: Segment0)"),
    ],
)  # fmt: skip
def test_segments_of_slicer_are_labels(lines: str, component: int | None, expected: list[Label] | str) -> None:
    header = "NRRD0004\ntype: uint8\ndimension: 4\nsizes: 2 2 3 2\nkinds: list domain domain domain\nencoding: raw\n"
    volume = read(written(Path("a.seg.nrrd"), f"{header}{lines}\n".encode() + VOXELS.tobytes()), component=component)
    assert volume.labels == (() if isinstance(expected, str) else tuple(expected))
    assert {channel.is_light for channel in volume.channels} == {not volume.labels}
    assert ("the labels in this file are left out" in (volume.note or "")) == isinstance(expected, str)
    assert not isinstance(expected, str) or expected in (volume.note or "")


def caret(*tables: str) -> str:
    parts = "".join(
        f'<VolumeInformation Index="0"><LabelTable>{each}</LabelTable></VolumeInformation>' for each in tables
    )
    return f'<?xml version="1.0" encoding="UTF-8"?> <CaretExtension>{parts}</CaretExtension>\n  '


ONE = '<Label Key="2" Red="1" Green="0" Blue="0.0" Alpha="0.5"><![CDATA[a\nÄ]]></Label>'
OTHER = '<Label Key="-3">b &amp; c</Label>'
NIML = '<VALUE_LABEL_DTABLE\n ni_type="2*String"\n ni_dimen="2" >\n "1" "a b"\n "20" "c&amp;d"\n</VALUE_LABEL_DTABLE>'
AFNI = escape(NIML).replace("\n", "&#x0a;")
AFNI = f'<AFNI_attributes><AFNI_atr atr_name="VALUE_LABEL_DTABLE" >\n "{AFNI[:60]}"\n "{AFNI[60:]}"</AFNI_atr>'
EXTENSIONS: list[tuple[str | bytes, dict[str, Any], list[Label] | str]] = [
    (caret(ONE), {}, [Label(2, "a Ä", RED, 0.5)]),
    (caret(ONE + OTHER), {}, [Label(-3, "b & c"), Label(2, "a Ä", RED, 0.5)]),
    (caret(ONE, OTHER), {"time": 1}, [Label(-3, "b & c")]),
    (AFNI, {}, [Label(1, "a b"), Label(20, "c&d")]),
    ("1 a\n2 b\n", {}, []),
    ("1 a\n2 b\n", {"intent": 1002}, [Label(1, "a"), Label(2, "b")]),
    ("2" + ITK_SNAP.partition("\n2")[2], {"intent": 1002}, [Label(2, "a", RED, 0.5), Label(4, "b", GREEN, 0.0)]),
    ("a comment", {"intent": 1002}, []),
    (caret(ONE)[:-30], {}, "not valid XML"),
    (caret(ONE + ONE), {}, "a label twice (a.nii: <Label> 2)"),
    (caret(ONE).replace('"0.0"', '"9"'), {}, "not such a number (a.nii: <Label> 1)"),
    (caret(ONE).replace(" <Caret", '<!DOCTYPE a [<!ENTITY a "a">]><Caret'), {}, "has a document type"),
    (b"<LabelTable\xff", {}, "not a text file in UTF-8"),
]  # fmt: skip


# Extensions lie in files of either byte order, and in compressed ones.
FORMS = [
    *((*each, "a.nii", "<") for each in EXTENSIONS),
    *((*each, *form) for each in EXTENSIONS[2:5] for form in (("a.nii", ">"), ("a.nii.gz", "<"))),
]


@pytest.mark.parametrize(("content", "choice", "expected", "name", "order"), FORMS)
def test_tables_in_extensions_of_nifti(
    content: str | bytes, choice: dict[str, Any], expected: list[Label] | str, name: str, order: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Compressed files are read in another process."""
    if name == "a.nii":
        monkeypatch.setattr("renderer.readers.volume_reading.read_isolated", read_here)
    values = np.random.default_rng(1).integers(0, 9, (128, 128, 80, 2), np.uint8)  # more than is read for the table
    image = NIBABEL.Nifti1Image(values, np.eye(4), NIBABEL.Nifti1Header(endianness=order))
    image.header["intent_code"] = choice.get("intent", 0)
    for each in (b"of another program", content if isinstance(content, bytes) else content.encode()):
        image.header.extensions.append(NIBABEL.nifti1.Nifti1Extension(0, each))
    image.to_filename(name)
    volume = read(Path(name), time=choice.get("time", 0))
    np.testing.assert_array_equal(volume.values, values[..., choice.get("time", 0)].T)
    assert volume.labels == (() if isinstance(expected, str) else tuple(expected))
    note = expected.replace("a.nii", name) if isinstance(expected, str) else ""
    assert note in (volume.note or "") and bool(note) == ("the labels in this file are left out" in (volume.note or ""))
