"""Damage volume files: pure functions of an undamaged volume and random numbers, so that a seed and a number give a
file."""

from __future__ import annotations

import os
import re
import socket
import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from volume_bases import Base, Ranges
from volume_bombs_isolated import BOMBS
from volume_bombs_text import TEXTS

Random = np.random.Generator
T = TypeVar("T")

# The share of volumes that are read as by the program, in a child process where the format has one.
SHARE_OF_CHILDREN = 0.1
SHARE_OF_BOMBS = 0.02


@dataclass(frozen=True)
class Node:
    """An object in place of a file: a `link` to `target`, a `fifo`, a `socket` or a `folder`."""

    kind: str
    target: str = ""


@dataclass(frozen=True)
class Sparse:
    """A file that goes on with zeros up to this many bytes, which take no place on the disk."""

    data: bytes
    num_bytes: int


Content = bytes | Node | Sparse


@dataclass(frozen=True, eq=False)
class Case:
    """A volume to be judged. damage: what was done to it. num_lost: the bytes that were cut off the end of a file.

    in_child: whether formats of large libraries are read in a child process, as the program does.
    """

    base: Base
    damage: str
    files: dict[str, Content]
    opened: str
    in_child: bool = False
    num_lost: int = 0


def make_case(bases: tuple[Base, ...], seed: int, index: int) -> Case:
    """Return volume `index` of a seed: all undamaged ones take turns."""
    rng = np.random.default_rng([seed, index])
    base = bases[index % len(bases)]
    case = _bomb(base, rng) if rng.random() < SHARE_OF_BOMBS else None
    while case is None:
        change = _CHANGES[int(rng.choice(len(_CHANGES), p=_SHARES))]
        case = change(base, rng)
    return replace(case, in_child=bool(rng.random() < SHARE_OF_CHILDREN))


def write_case(case: Case, folder: Path) -> Path:
    """Write the files of a case below a folder; return the path to open."""
    for name, content in case.files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, Node):
            _make_node(path, content)
        elif isinstance(content, Sparse):
            path.write_bytes(content.data)
            os.truncate(path, content.num_bytes)
        else:
            path.write_bytes(content)
    return folder / case.opened


def _make_node(path: Path, node: Node) -> None:
    if node.kind == "link":
        path.symlink_to(node.target)
    elif node.kind == "fifo":
        os.mkfifo(path)
    elif node.kind == "folder":
        path.mkdir()
    else:
        with socket.socket(socket.AF_UNIX) as opened:
            opened.bind(os.path.relpath(path) if len(str(path)) > 100 else str(path))


def is_within_checksums(case: Case) -> bool:
    """Return whether files differ from the undamaged ones, and only in bytes that a checksum covers."""
    if case.opened != case.base.opened or case.files.keys() != case.base.files.keys():
        return False
    has_changed = False
    for name, content in case.files.items():
        data = case.base.files[name]
        if content == data:
            continue
        if not isinstance(content, bytes) or (case.base.pack is not None and case.damage.endswith("unpacked")):
            return False
        has_changed = True
        if not all(_is_inside(span, case.base.guarded.get(name, ())) for span in _changed_spans(data, content)):
            return False
    return has_changed


def _is_inside(span: tuple[int, int], ranges: Ranges) -> bool:
    return any(begin <= span[0] and span[1] <= end for begin, end in ranges)


def _changed_spans(before: bytes, after: bytes) -> list[tuple[int, int]]:
    """Return the bytes of a file that were changed, moved or lost: one span if its length is another."""
    num = min(len(before), len(after))
    differ = np.flatnonzero(np.frombuffer(before[:num], np.uint8) != np.frombuffer(after[:num], np.uint8))
    if len(before) == len(after):
        return [(int(at), int(at) + 1) for at in differ]
    first = int(differ[0]) if differ.size else num
    tails = np.frombuffer(before[len(before) - num :], np.uint8) != np.frombuffer(after[len(after) - num :], np.uint8)
    last = num - 1 - int(np.flatnonzero(tails)[-1]) if tails.any() else num
    return [(first, max(first, len(before) - last))]


# Places and contents


def _pick(rng: Random, *choices: T) -> T:
    return choices[int(rng.integers(len(choices)))]


def _changed(base: Base, damage: str, name: str, data: bytes, **more: int) -> Case:
    """Return a case with another content of one file. name: empty for the content of the file before it was packed."""
    if name == "":
        assert base.pack is not None
        return Case(base, f"{damage} unpacked", {base.opened: base.pack(data)}, base.opened, **more)
    return Case(base, damage, {**base.files, name: data}, base.opened, **more)


def _any_content(base: Base, rng: Random) -> tuple[str, bytes]:
    """Return a file that is opened, or belongs to it; or the content of a file before it was packed."""
    if base.pack is not None and rng.random() < 0.5:
        return "", base.unpacked
    names = [name for name, data in base.files.items() if data]
    if base.opened in names and rng.random() < 0.5:
        return base.opened, base.files[base.opened]
    name = names[int(rng.integers(len(names)))]
    return name, base.files[name]


def _place(base: Base, name: str, data: bytes, rng: Random) -> int:
    """Return a place in the header of a file, where checksums hold, or anywhere."""
    kind = rng.random()
    ranges = base.headers.get(name, ()) if kind < 0.5 else base.guarded.get(name, ()) if kind < 0.8 else ()
    if not ranges:
        return int(rng.integers(len(data)))
    begin, end = ranges[int(rng.integers(len(ranges)))]
    return int(rng.integers(begin, max(end, begin + 1)))


def _bits(base: Base, rng: Random) -> Case:
    name, data = _any_content(base, rng)
    damaged = bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        damaged[min(_place(base, name, data, rng), len(data) - 1)] ^= 1 << int(rng.integers(8))
    return _changed(base, "flipped bits", name, bytes(damaged))


_DIGITS = b"0123456789.e+-\\\n \t(),:<>\"'="


def _bytes(base: Base, rng: Random) -> Case:
    name, data = _any_content(base, rng)
    damaged = bytearray(data)
    place = _place(base, name, data, rng)
    for at in range(place, min(place + int(rng.integers(1, 9)), len(data))):
        to, digit = int(rng.integers(256)), _DIGITS[int(rng.integers(len(_DIGITS)))]
        damaged[at] = (to, 0, 255, digit, digit)[int(rng.integers(5))]
    return _changed(base, "other bytes", name, bytes(damaged))


def _cut(base: Base, rng: Random) -> Case:
    name, data = _any_content(base, rng)
    most = _pick(rng, len(data), min(40, len(data)), len(data))
    num_lost = int(rng.integers(1, most + 1))
    kept = int(rng.integers(min(400, len(data)))) if rng.random() < 0.3 else len(data) - num_lost
    return _changed(base, "truncated", name, data[:kept], num_lost=0 if name == "" else len(data) - kept)


def _longer(base: Base, rng: Random) -> Case:
    name, data = _any_content(base, rng)
    num = _pick(rng, 1, 2, 13, 512, 5000)
    more = _pick(rng, rng.bytes(num), bytes(num), data, b"\n" * num)
    return _changed(base, "with more at its end", name, data + more)


def _block(base: Base, rng: Random) -> Case:
    name, data = _any_content(base, rng)
    begin = _place(base, name, data, rng)
    end = min(len(data), begin + _pick(rng, 1, 2, 4, 16, 100, 512))
    block, other = data[begin:end], int(rng.integers(len(data)))
    damaged = _pick(
        rng,
        data[:begin] + data[end:],
        data[:end] + block + data[end:],
        data[:begin] + bytes(len(block)) + data[end:],
        data[:begin] + b"\xff" * len(block) + data[end:],
        data[:begin] + rng.bytes(len(block)) + data[end:],
        data[:begin] + data[other : other + len(block)].ljust(len(block), b"\0") + data[end:],
        data[:begin] + rng.bytes(int(rng.integers(1, 9))) + data[begin:],
    )
    return _changed(base, "with a block moved or lost", name, damaged)


_ENDS = (0, 1, 2, 2**7, 2**8 - 1, 2**15 - 1, 2**15, 2**16 - 1, 2**16, 2**31 - 1, 2**31, 2**32 - 1, 2**32, 2**40)
_ENDS += (2**63 - 1, 2**63, 2**64 - 1)
_FLOATS = (float("nan"), float("inf"), -1.0, 1e30, 1e-38, 3e9)


def _number(base: Base, rng: Random) -> Case:
    """A number of a header, such as a length or an offset, becomes an extreme one."""
    name, data = _any_content(base, rng)
    num, order = _pick(rng, 2, 4, 4, 8), _pick(rng, "<", ">")
    place = _place(base, name, data, rng)
    if rng.random() < 0.7:
        place = place // num * num
    ends = (*_ENDS, len(data), len(data) - 1, place, int(rng.integers(1, 1000)))
    value = int(ends[int(rng.integers(len(ends)))]) % 2 ** (8 * num)
    written = value.to_bytes(num, "little" if order == "<" else "big")
    if num > 2 and rng.random() < 0.2:
        written = struct.pack(order + ("f" if num == 4 else "d"), _pick(rng, *_FLOATS))
    return _changed(base, "with an extreme number", name, (data[:place] + written + data[place + num :])[: len(data)])


_NUMBERS = (
    "0", "-1", "1", "2", "3", "4", "5", "16", "17", "255", "65536", "2147483647", "2147483648", "4294967295",
    "4294967296", "9223372036854775807", "18446744073709551616", "1e300", "1e309", "1e-320", "-0", "nan", "inf", "-inf",
    "0x10", "1_0", "9" * 400, "0" * 5000 + "1", "1e5", "1.5", "\u0663", "", "100000", "1000000", "\x1b[2J", "1;2",
)  # fmt: skip


def _written_number(base: Base, rng: Random) -> Case | None:
    """A number in the text of a header becomes another one."""
    name, data = _any_content(base, rng)
    begin, end = _header(base, name, data)
    places = [found.span() for found in re.finditer(rb"[-+]?[0-9][0-9.eE+-]*", data[begin:end])]
    if not places:
        return None
    first, last = (begin + at for at in places[int(rng.integers(len(places)))])
    written = _pick(rng, *_NUMBERS).encode()
    if base.form in ("tiff", "dicom", "npy"):  # of which the length must not change
        written = written[: last - first].ljust(last - first)
    return _changed(base, "with another number in its text", name, data[:first] + written + data[last:])


def _header(base: Base, name: str, data: bytes) -> tuple[int, int]:
    ranges = base.headers.get(name, ())
    return (ranges[0][0], ranges[-1][1]) if ranges else (0, min(len(data), 1000))


def _line(base: Base, rng: Random) -> Case | None:
    """A line of a header is doubled, lost, moved, overlong, or in a file that did not have it."""
    if base.form not in ("nrrd", "metaimage", "cube", "vtk"):
        return None
    name, data = base.opened, base.files[base.opened]
    _, end = _header(base, name, data)
    lines, rest = data[:end].split(b"\n"), data[end:]
    at, other = (int(rng.integers(len(lines))) for _ in range(2))
    line, kind = lines[at], int(rng.integers(11))
    key, mark, value = line.partition(b":" if base.form == "nrrd" else b"=")
    if kind == 0:
        lines.insert(other, line)
    elif kind == 1:
        del lines[at]
    elif kind == 2:
        lines[at], lines[other] = lines[other], line
    elif kind == 3:
        lines[at] = line + line[-1:] * _pick(rng, 100, 1000, 100_000)
    elif kind == 4:
        lines[at] = key + mark + (value + b" ") * _pick(rng, 2, 10, 1000, 100_000)
    elif kind == 5:
        lines.insert(at, b"x" * _pick(rng, 10, 992, 5000, 2**20))
    elif kind == 6:
        lines[at] = key + mark + b" \x1b[31m\r\xe2\x80\xae\x07\x00" + value
    elif kind == 7:
        lines[at] = key + mark + lines[other].partition(mark or b" ")[2]
    elif kind == 8:
        lines = [each + b"\r" for each in lines]
    elif kind == 9:
        lines[at] = key.replace(b" ", b" " * 2000) + mark + value
    else:
        lines[at] = key.swapcase() + mark + value + b" " + rng.bytes(5)
    return _changed(base, "with other lines", name, b"\n".join(lines) + rest)


_WORDS = {
    "nrrd": """int8 uchar short uint32 longlong double block raw gzip bzip2 text hex zrl little big LIST domain space
        time list vector RGB-color none ??? cell node right-anterior-superior LPS scanner-xyz 3D-right-handed /dev/zero
        /dev/full /dev/stdin .. . a.nrrd a.nhdr s%d.raw s%99d.raw %s %n s%03d.raw (1,0,0) (1,2) (nan,nan,nan) ()
        (1e308,1e308,1e308)""",
    "metaimage": """MET_CHAR MET_ULONG_LONG MET_DOUBLE MET_UCHAR MET_STRING True False LOCAL Local LIST a.mha a.mhd
        a.raw /dev/zero /dev/full .. . s%d.raw s%d.raw_0_3_1 Image Tube RAS""",
    "cube": "0 -1 1e300 nan 999999999 0.5 -7 x",
    "vtk": """Int8 UInt64 Float64 Bit String ascii binary appended raw base64 UInt32 UInt64 LittleEndian BigEndian
        ImageData RectilinearGrid PolyData vtkZLibDataCompressor vtkLZ4DataCompressor vtkLZMADataCompressor vtkFoo &lt;
        &a; STRUCTURED_POINTS UNSTRUCTURED_GRID ASCII BINARY short vtkIdType unsigned_char bit string variant POINT_DATA
        CELL_DATA FIELD SCALARS VECTORS LOOKUP_TABLE TENSORS COLOR_SCALARS METADATA DATASET NORMALS""",
}


def _word(base: Base, rng: Random) -> Case | None:
    """A word of a header becomes another one that means something there."""
    if base.form not in _WORDS:
        return None
    name, data = base.opened, base.files[base.opened]
    begin, end = _header(base, name, data)
    places = [found.span() for found in re.finditer(rb"[^\s\"=<>]+", data[begin:end])]
    first, last = (begin + at for at in places[int(rng.integers(len(places)))])
    word = _pick(rng, *_WORDS[base.form].split()).encode()
    return _changed(base, "with another word in its header", name, data[:first] + word + data[last:])


_TARGETS = ("nowhere", "/dev/zero", "/dev/full", "/dev/null", "/dev/stdin", ".", "..", "/proc/self/mem")


def _node(base: Base, rng: Random) -> Case:
    """Something else has the name of a file."""
    name = _pick(rng, *base.files)
    links = [Node("link", target) for target in (*_TARGETS, os.path.basename(name))]
    node = _pick(rng, *links, Node("fifo"), Node("socket"), Node("folder"))
    return Case(base, f"replaced by a {node.kind}", {**base.files, name: node}, base.opened)


def _missing(base: Base, rng: Random) -> Case:
    """A file is missing, twice there, empty, or there under a link."""
    name = _pick(rng, *base.files)
    files: dict[str, Content] = dict(base.files)
    kind, other = int(rng.integers(5)), os.path.join(os.path.dirname(name), f"copy of {os.path.basename(name)}")
    if kind == 0:
        del files[name]
    elif kind == 1:
        files[other] = files[name]
    elif kind == 2:
        files[name] = b""
    elif kind == 3:
        files[other], files[name] = files[name], Node("link", os.path.basename(other))
    else:
        files[os.path.join(os.path.dirname(name), "pipe.dcm")] = Node("fifo")
    return Case(base, "with a file missing or twice", files, base.opened)


_NAMES = (
    "\x1b[31m\n\r", "\u202egnp", "\udcff\udcfe", "x" * 200, "\u200b", " ", "%d%n", "'\"", "\\x1b", "-", "{}", "\x7f",
)  # fmt: skip


def _renamed(base: Base, rng: Random) -> Case:
    """A file, perhaps damaged as well, has a name that must not reach a terminal."""
    name = _pick(rng, *base.files)
    folder, file = os.path.split(name)
    part = _NAMES[int(rng.integers(len(_NAMES)))]
    other = os.path.join(
        folder, str(_pick(rng, part + file, file.replace(".", part + ".", 1), "." + file, file + part))
    )
    files: dict[str, Content] = dict(base.files)
    data = base.files[name]
    del files[name]
    files[other] = _pick(rng, data, data[: len(data) // 2], data[:100], data + data)
    return Case(base, "with another name", files, other if base.opened == name else base.opened)


def _sparse(base: Base, rng: Random) -> Case:
    """A file goes on with zeros, up to a length that no memory holds."""
    name = _pick(rng, *base.files)
    num_bytes = _pick(rng, 2**31, 2**32 + 2**20, 2**33)
    return Case(base, "with gigabytes of zeros", {**base.files, name: Sparse(base.files[name], num_bytes)}, base.opened)


def _folder(base: Base, rng: Random) -> Case:
    """The folder is opened in place of the file, with other things in it."""
    files: dict[str, Content] = {f"in/{name}": data for name, data in base.files.items()}
    for k in range(int(rng.integers(3))):
        other = _pick(
            rng, Node("fifo"), Node("link", "."), Node("link", "/dev/zero"), b"text", b"", Node("link", "/proc")
        )
        files[_pick(rng, f"in/{k}.tif", f"in/{k}", f"in/{k}.dcm", f"in/{k}.nrrd", f"in/.{k}", f"in/more/{k}.mha")] = (
            other
        )
    return Case(base, "its folder is opened", files, _pick(rng, "in", "in", "in/more/..", "."))


def _unchanged(base: Base, rng: Random) -> Case:
    return Case(base, "unchanged", dict(base.files), base.opened)


def _spliced(base: Base, rng: Random) -> Case:
    """The beginning of a file is behind itself, at another place, or inside out."""
    name, data = _any_content(base, rng)
    first, second = (_place(base, name, data, rng) for _ in range(2))
    damaged = _pick(rng, data[:first] + data[second:], data[second:], data[:first] + data, data[first:] + data[:first])
    return _changed(base, "spliced", name, damaged)


def _bomb(base: Base, rng: Random) -> Case | None:
    """A small file that asks for much work or memory."""
    groups = [group[base.form] for group in (BOMBS, TEXTS) if base.form in group]
    return make_bomb(base, _pick(rng, *_pick(rng, *groups))) if groups else None


def make_bomb(base: Base, bomb: str) -> Case:
    """Return a case with the files of a bomb in place of those of an undamaged volume."""
    files: dict[str, Content] = {
        name: Sparse(*content) if isinstance(content, tuple) else content
        for name, content in (BOMBS[base.form] | TEXTS.get(base.form, {}))[bomb]().items()
    }
    opened = next(iter(files))
    return Case(base, f"bomb: {bomb.replace('_', ' ')}", files, os.path.dirname(opened) or opened)


_CHANGES: tuple[Callable[[Base, Random], Case | None], ...] = (
    _bits, _bytes, _cut, _longer, _block, _number, _written_number, _line, _word, _node, _missing, _renamed, _sparse,
    _folder, _unchanged, _spliced,
)  # fmt: skip
_SHARES = np.array([16, 14, 10, 4, 8, 12, 8, 6, 5, 3, 3, 3, 1, 2, 2, 3]) / 100
