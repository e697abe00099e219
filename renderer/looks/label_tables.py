"""Read tables of labels from files and from the headers of images, with one parser for each format.

Files are those of FreeSurfer, 3D Slicer, ITK-SNAP, FSLeyes, MRIcron and BIDS. Headers hold XML as in GIFTI and CIFTI,
AFNI's format, or text. A row is a place in the file (for messages), a value, a name, and perhaps a colour: red, green,
blue and perhaps an opacity. In a look, a label without an opacity is opaque, and label 0 is the transparent background.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from renderer.errors import InputError
from renderer.looks.look_file import MAX_LOOK_BYTES, LookFile
from renderer.system import unescaped, whole_number_in
from renderer.volume import Label

# The largest number of labels of a table.
_MAX_LABELS = 2**16
# The largest number of characters of a label's name; longer names are cut.
_MAX_NAME_LENGTH = 200
# The largest value of a label: float64 has all whole numbers up to this one.
_MAX_VALUE = 2.0**53
# The names of the groups in the regular expressions that match a row of a table of labels. Every expression has the
# groups `label` and `name`.
_ROW_PARTS = ("label", "name", "r", "g", "b", "alpha", "is_shown")
# Red, green and blue of a row, as whole numbers.
_RGB = r"(?P<r>\d+)\s+(?P<g>\d+)\s+(?P<b>\d+)"
# Red, green and blue of a row, as numbers that may have a decimal point.
_SHARES = _RGB.replace(r"\d+", r"[-+.\deE]+")
# A row of FreeSurfer or 3D Slicer: label, name, red, green, blue, and transparency or alpha.
_FREESURFER = re.compile(rf'(?P<label>\d+)\s+(?P<name>"[^"]*"|\S+)\s+{_RGB}\s+(?P<alpha>\d+)(?:\s.*)?').fullmatch
# A row of FSLeyes: label, red, green, blue, and perhaps a name.
_FSLEYES = re.compile(rf"(?P<label>\d+)\s+{_SHARES}(?P<name>(?:\s.*)?)").fullmatch
# A row of ITK-SNAP: label, red, green, blue, alpha, whether the label is shown, whether its surface is shown, and name.
_ITK_SNAP = re.compile(
    rf'(?P<label>\d+)\s+{_SHARES}\s+(?P<alpha>[-+.\deE]+)\s+(?P<is_shown>[01])\s+[01]\s+(?P<name>".*")'
).fullmatch
# A row of MRIcron, or of other tables of names: label and name.
_NAMED = re.compile(r"(?P<label>\d+)[\s,]+(?P<name>[^\s,].*)").fullmatch
# A number that may follow the name in a row of MRIcron: the label in another table.
_OTHER_NUMBER = re.compile(r"\d{4,}")
_HEX_COLOR = re.compile(r"#[\da-fA-F]{6}")

# Finds a row of FSLeyes in the content of a file: label, three numbers and a name.
_FSLEYES_ROW = re.compile(rb"(?m)^[ \t]*\d+([ \t]+[.\d]+){3}[ \t]+\S")
# Finds a row of ITK-SNAP in the content of a file: two numbers, and a quote in the same line.
_ITK_SNAP_ROW = re.compile(rb'(?m)^[ \t]*\d+[ \t]+[-+.\d][^"\n]*"')
# Matches a row with a label and a name, but without a colour of four numbers.
_NAMED_ROW = re.compile(rb"\d+[ \t,]+(?![ \t,])(?!\S+([ \t]+\d+){4})")
# Matches the first line of a colour table of 3D Slicer.
_COLOR_TABLE = re.compile(rb"\A# Color table file")
# The size in bytes of a table of 256 colours without a header.
_NUM_BYTES = 768
# The mark of the XML attribute that holds a table of labels in the headers of AFNI.
_AFNI_MARK = 'atr_name="VALUE_LABEL_DTABLE"'

# A table of labels beside a volume has the volume's name without suffixes, and then one of these ends.
_ENDS = (
    ".ctbl",
    ".txt",
    ".lut",
    ".label",
    ".tsv",
    ".csv",
    "_LUT.txt",
    "-label.txt",
    "-labels.txt",
    "_labels.txt",
    "_ColorTable.ctbl",
    "_ColorTable.csv",
)
# Finds the suffixes at the end of a volume's name.
_VOLUME_SUFFIXES = re.compile(r"(\.seg)?\.[^.]+(\.gz)?\Z", re.IGNORECASE)
# The number of folders above a volume in which a table is searched for. In BIDS, the table of a whole data set lies
# beside the folders of its subjects.
_MAX_FOLDERS_UP = 3

# A row of a table: its place in the file (for messages), a label, a name, and perhaps red, green, blue and an opacity.
Row = Sequence[Any]
# A function that tests the content of a file, and returns a value that counts as true if the content has the format.
Sign = Callable[[bytes], object]
# A function that matches a line of text with the regular expression of a row.
_Match = Callable[[str], "re.Match[str] | None"]
# A function that reads the labels in a file.
LabelReader = Callable[[LookFile], tuple[Label, ...]]


def make_labels(file: LookFile, rows: Iterable[Row], white: float) -> tuple[Label, ...]:
    """Return the labels of rows, sorted by value.

    white: the number that stands for full red, green or blue, and for full opacity. Raises InputError for values that
    are not whole numbers, and for no labels, too many labels, or the same label twice.
    """
    labels, places = list[Label](), dict[int, object]()
    for at, value, name, *parts in rows:
        number = file.number(value, at, -_MAX_VALUE, _MAX_VALUE)
        if not number.is_integer():
            raise file.error("not a label", at, got=value, expected="a whole number")
        label = int(number)
        if label in places:
            first = f"line {places[label]}" if isinstance(places[label], int) else places[label]
            raise file.error("a label twice", at, got=label, expected=f"each label once; it is in {first}, too")
        if len(labels) == _MAX_LABELS:
            raise file.error("too many labels", at, expected=f"at most {_MAX_LABELS}")
        r, g, b, opacity = [*(file.number(part, at, 0.0, white) / white for part in parts), *[None] * 4][:4]
        color = None if r is None or g is None or b is None else (r, g, b)
        words = " ".join(str(name)[: 2 * _MAX_NAME_LENGTH].split()).encode("utf-8", "replace").decode("utf-8")
        labels.append(Label(label, words[:_MAX_NAME_LENGTH], color, opacity))
        places[label] = at
    if not labels:
        raise file.error("no labels")
    return tuple(sorted(labels, key=lambda label: label.value))


def read_label_table(path: Path) -> tuple[Label, ...]:
    """Return the labels of the table in a file, sorted by value. Raises InputError for a file without a valid table."""
    if not path.is_file():  # a pipe would block when it is opened
        raise InputError("not a file", where=str(path), expected="a table of labels")
    try:
        with path.open("rb") as opened:
            content = opened.read(MAX_LOOK_BYTES + 1)
    except OSError as error:
        raise InputError("cannot be read", where=str(path), got=error.strerror) from error
    if len(content) > MAX_LOOK_BYTES:
        raise InputError("too large for a table of labels", where=str(path), expected=f"at most {MAX_LOOK_BYTES} bytes")
    return parse_label_table(path, path.suffix, content)


def parse_label_table(path: Path, suffix: str, content: bytes) -> tuple[Label, ...]:
    """Return the labels of a table, whose format follows from the suffix and the content.

    path: the file, for messages.
    """
    for end, sign, kind, read in (*LABEL_FORMATS, (".lut", _is_bytes, "colours of labels: 768 bytes", _read_bytes)):
        if suffix.lower() == end and sign(content):
            return read(LookFile(path, content, kind))
    suffixes = ", ".join(dict.fromkeys(end for end, *_ in LABEL_FORMATS))
    raise InputError("not a kind of table of labels that is known", where=str(path), expected=f"a file {suffixes}")


def find_label_table(volume_file: Path) -> Path | None:
    """Return the first file beside a volume that has the name and the content of a table of its labels.

    In BIDS, the table of a volume `..._dseg` may lie in a folder above, and leave out parts of the volume's name.
    """
    stem, folder = _VOLUME_SUFFIXES.sub("", volume_file.name), volume_file.parent
    stems = dict.fromkeys((stem, re.sub(r"\.gz\Z", "", volume_file.name, flags=re.IGNORECASE)))
    found = [folder / (each + end) for each in stems for end in _ENDS]
    parts = stem.split("_")
    if parts[-1] == "dseg":
        for above in volume_file.absolute().parents[: _MAX_FOLDERS_UP + 1]:
            fits = [path for path in above.glob("*dseg.tsv") if {*path.stem.split("_")} <= {*parts}]
            found += sorted(fits, key=lambda path: (-len(path.stem), path.stem))
    for path in found:
        with suppress(InputError, OSError):
            read_label_table(path)
            return path
    return None


def read_extension(path: Path, content: bytes, image: int, *, are_labels: bool) -> tuple[Label, ...]:
    """Return the labels in an extension of the header of an image file; none if it has no table of labels.

    content: the bytes of the extension. image: the index of the image that is read, if each image of the file has a
    table. are_labels: whether the header says that voxels are labels; only then, a text with rows of labels counts as a
    table. Raises InputError for a wrong table in XML or in AFNI's format.
    """
    content = content.rstrip(b"\0 ")
    if b"<LabelTable" in content:
        return _read_xml(LookFile(path, content, "a table of labels in XML"), image)
    if _AFNI_MARK.encode() in content:
        return _read_afni(LookFile(path, content, "a table of labels of AFNI"))
    try:
        return parse_label_table(path, ".txt", content) if are_labels else ()
    except InputError:
        return ()


def _rows(file: LookFile, match: _Match) -> Iterator[Row]:
    """Yield the row of each line of a file. Raises InputError for a line that does not match.

    match: matches a line with a regular expression whose named groups are the parts of a row.
    """
    for line, text in file.lines():
        found = match(text)
        if found is None:
            raise file.error("not a row of a table of labels", line, got=text, expected="a label and its colour")
        label, name, *parts = (found.groupdict().get(key) for key in _ROW_PARTS)
        yield line, label, (name or "").strip().strip('"'), *(part for part in parts if part is not None)


def _read_names(file: LookFile) -> tuple[Label, ...]:
    """Return the labels of rows with a label and a name; each name must have a letter."""
    rows = list[Row]()
    for line, label, text in _rows(file, _NAMED):
        words = text.rsplit(maxsplit=1)
        name = words[0] if len(words) > 1 and _OTHER_NUMBER.fullmatch(words[1]) else text
        if not any(map(str.isalpha, name)):
            raise file.error(
                "not a row of a table of labels", line, got=f"{label} {name}", expected="a label and a name"
            )
        rows.append((line, label, name))
    return make_labels(file, rows, 1.0)


def _read_rows(match: _Match, white: float, file: LookFile) -> tuple[Label, ...]:
    return make_labels(file, _rows(file, match), white)


def _read_freesurfer(file: LookFile) -> tuple[Label, ...]:
    """Return the labels of FreeSurfer, whose rows have a transparency in place of an opacity."""
    rows = ((*row, 255 - file.number(clear, row[0], 0, 255)) for *row, clear in _rows(file, _FREESURFER))
    return make_labels(file, rows, 255.0)


def _read_itk_snap(file: LookFile) -> tuple[Label, ...]:
    """Return the labels of ITK-SNAP, whose colours are from 0 to 255, and whose opacities are from 0 to 1."""
    rows = (
        (*row, 255 * file.number(alpha if is_shown == "1" else 0, row[0], 0, 1))
        for *row, alpha, is_shown in _rows(file, _ITK_SNAP)
    )
    return make_labels(file, rows, 255.0)


def _read_columns(file: LookFile) -> tuple[Label, ...]:
    """Return the labels of a table with a heading: of BIDS, or of 3D Slicer with a colour in four columns."""
    mark = "\t" if file.path.suffix.lower() == ".tsv" else ","
    (first, heading), *lines = [*file.lines()] or [(1, "")]
    keys, rows = [key.lower() for key in _cells(file, first, heading, mark)], list[Row]()
    if not {"index", "labelvalue"} & {*keys}:
        raise file.error("no column `index`", first, got=heading, expected="a heading, such as index, name, color")
    for line, text in lines:
        row = dict(zip(keys, _cells(file, line, text, mark), strict=False))
        label, name = row.get("index", row.get("labelvalue")), row.get("name", row.get("label", ""))
        rows.append((line, label, name, *_color(file, line, row)))
    return make_labels(file, rows, 255.0)


def _cells(file: LookFile, line: int, text: str, mark: str) -> list[str]:
    """Return the cells of a row, which may be in quotes. mark: the separator."""
    try:
        return [cell.strip() for cell in next(csv.reader([text], delimiter=mark, skipinitialspace=True))]
    except csv.Error as error:
        raise file.error(f"not a row of cells: {error}", line, got=text) from error


def _color(file: LookFile, line: int, row: Mapping[str, str]) -> list[Any]:
    """Return red, green, blue and alpha, from 0 to 255, of a row of cells; none without a colour."""
    color = row.get("color", "n/a") or "n/a"
    if _HEX_COLOR.fullmatch(color):
        return [*bytes.fromhex(color[1:])]
    if color.lower() != "n/a":
        raise file.error("not a colour", line, got=color, expected="#rrggbb or n/a")
    return [row[key] for key in ("color_r", "color_g", "color_b", "color_a") if row.get(key)]


def _read_bytes(file: LookFile) -> tuple[Label, ...]:
    """Return the labels 0 to 255, with colours from 768 bytes: all red values, all green values, all blue values."""
    return make_labels(file, ((f"colour {k}", k, "", *file.content[k::256]) for k in range(256)), 255.0)


def _read_xml(file: LookFile, image: int) -> tuple[Label, ...]:
    """Return the labels of elements `<Label Key="1" Red="0.2" Green="1" Blue="0" Alpha="1">name</Label>`."""
    tables = list(file.xml().iter("LabelTable"))
    table = tables[image if image < len(tables) else 0]
    rows = ((f"<Label> {k}", label.get("Key"), label.text or "",
             *(label.get(part, "1") for part in ("Red", "Green", "Blue", "Alpha") if "Red" in label.attrib))
            for k, label in enumerate(table.iter("Label"), start=1))  # fmt: skip
    return make_labels(file, rows, 1.0)


def _read_afni(file: LookFile) -> tuple[Label, ...]:
    """Return the labels in AFNI's attribute for tables, which holds rows `"1" "name"`, in quotes and escaped."""
    text = file.text().partition(_AFNI_MARK)[2].partition(">")[2].partition("<")[0]
    table = unescaped("".join(text.split('"')[1::2]))
    rows = list[Row]()
    for line in table.split("\n"):
        value, *name = line.split(maxsplit=1)[:2] or [""]
        if name and whole_number_in(value.strip('"')) is not None:
            rows.append((f"row {len(rows) + 1}", value.strip('"'), unescaped(name[0].lstrip('"').partition('"')[0])))
    return make_labels(file, rows, 1.0)


def _is_bytes(content: bytes) -> bool:
    return len(content) == _NUM_BYTES


def any_content(_content: bytes) -> bool:
    """Return True. This is the test of the content for formats that are recognised by the suffix of the file alone."""
    return True


def _begins_with_name(content: bytes) -> bool:
    """Return whether the first line that is no comment is a row with a label and a name."""
    rows = (line.strip(b" \t\r") for line in content.removeprefix(b"\xef\xbb\xbf").split(b"\n"))
    first = next((row for row in rows if row and not row.startswith(b"#")), b"")
    return _NAMED_ROW.match(first) is not None


# The formats of tables of labels, described for error messages.
_FSLEYES_LABELS = "labels of FSLeyes: rows of label, red, green, blue and name"
_SLICER_LABELS = "labels of 3D Slicer: rows of label, name, red, green, blue and alpha"
_ITK_LABELS = "labels of ITK-SNAP: rows of label, red, green, blue, alpha, two flags and a name in quotes"
_NAMES = "names of labels: rows of label and name"
_COLUMNS = "labels in columns: index, name and color as #rrggbb"

# The formats of tables of labels, each with its suffix, the test of its content, its description for errors, and its
# reader. The first format whose suffix and test fit a file reads it.
LABEL_FORMATS: tuple[tuple[str, Sign, str, LabelReader], ...] = (
    (".lut", _FSLEYES_ROW.search, _FSLEYES_LABELS, partial(_read_rows, _FSLEYES, 1.0)),
    (".ctbl", any_content, _SLICER_LABELS, partial(_read_rows, _FREESURFER, 255.0)),
    (".txt", _COLOR_TABLE.search, _SLICER_LABELS, partial(_read_rows, _FREESURFER, 255.0)),
    (".txt", _ITK_SNAP_ROW.search, _ITK_LABELS, _read_itk_snap),
    (".label", any_content, _ITK_LABELS, _read_itk_snap),
    *((suffix, _begins_with_name, _NAMES, _read_names) for suffix in (".txt", ".tsv", ".csv")),
    (
        ".txt",
        any_content,
        "labels of FreeSurfer: rows of label, name, red, green, blue and transparency",
        _read_freesurfer,
    ),
    *((suffix, any_content, _COLUMNS, _read_columns) for suffix in (".tsv", ".csv")),
)
