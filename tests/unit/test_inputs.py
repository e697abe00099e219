"""The files of a volume are found, and no output may overwrite one of them."""

from __future__ import annotations

import gzip
import json
import os
import sys
from pathlib import Path
from unittest import mock

import nibabel
import numpy as np
import pytest
from small_scene import small_tree

from renderer.errors import InputError
from renderer.film import require_no_input
from renderer.job import FilmJob, scene_files, volume_files
from renderer.scene import FileSource, ProceduralSource, RawSource, VolumeSpec, accuracy_of, parse_scene

pytestmark = pytest.mark.usefixtures("folder")

NRRD = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n"


def names_of(volume: str) -> list[str]:
    found = {path.resolve() for path in volume_files(VolumeSpec(FileSource(Path(volume))))}
    return sorted(path.name for path in found)


def test_an_output_that_is_no_input() -> None:
    Path("a").touch()
    Path("b").touch()
    require_no_input([Path("a"), Path("c")], [Path("b"), Path("c"), Path("d" * 300)])


def test_inputs_are_looked_at_where_an_output_is_there_only() -> None:
    def fail(path: Path) -> Path:
        raise AssertionError(path)

    require_no_input([Path("film.mp4")], map(fail, [Path("a")]))


@pytest.mark.parametrize("link", ["same", "hard", "symbolic", "folder"])
def test_an_output_that_is_an_input(link: str) -> None:
    Path("in").mkdir()
    scan, output = Path("in/scan.raw"), Path("film.mp4")
    scan.write_bytes(bytes(8))
    if link == "same":
        output = Path("in/../in/scan.raw")
    elif link == "hard":
        output.hardlink_to(scan)
    elif link == "symbolic":
        output.symlink_to(scan)
    else:
        Path("out").symlink_to("in")
        output = Path("out/scan.raw")
    with pytest.raises(InputError) as error:
        require_no_input([Path("other.mp4"), output], volume_files(VolumeSpec(RawSource(scan, (2, 2, 2), "uint8"))))
    assert str(error.value) == (
        f"{output}: this output would overwrite an input\n"
        "  got: the input in/scan.raw\n"
        "  expected: a file that is not read\n"
        "  hint: give the output another name or folder"
    )


def test_files_of_volumes() -> None:
    assert list(volume_files(VolumeSpec(ProceduralSource("constant", (2, 2, 2))))) == []
    for name in ("a.raw", "b.raw"):
        Path(name).write_bytes(bytes(8))
    for suffix in ("nrrd", "nhdr"):
        Path(f"v.{suffix}").write_text(f"{NRRD}data file: a.raw\n", encoding="ascii")
        assert names_of(f"v.{suffix}") == ["a.raw", f"v.{suffix}"]
    Path("v.nhdr").rename("v.txt")  # the content shows the format
    assert names_of("v.txt") == ["a.raw", "v.txt"]
    Path("b.raw").write_bytes(b"a line\n" + gzip.compress(bytes(8)))
    packed = NRRD.replace("raw", "gzip\nline skip: 1\ndata file: b.raw")
    Path("packed.nhdr").write_text(packed, encoding="ascii")
    assert names_of("packed.nhdr") == ["b.raw", "packed.nhdr"]
    for end in ("", ".gz"):
        nibabel.Nifti1Pair(np.zeros((2, 2, 2), np.uint8), np.eye(4)).to_filename(f"pair.hdr{end}")
        assert names_of(f"pair.img{end}") == [f"pair.hdr{end}", f"pair.img{end}"]
    Path("list.nhdr").write_text(f"{NRRD}data file: LIST\na.raw\nb.raw\n", encoding="ascii")
    assert names_of("list.nhdr") == ["a.raw", "b.raw", "list.nhdr"]
    Path("v.mhd").write_text(
        "NDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\nElementDataFile = b.raw\n", encoding="ascii"
    )
    assert names_of("v.mhd") == ["b.raw", "v.mhd"]
    Path("broken.nhdr").write_text(f"{NRRD}data file: c.raw\n", encoding="ascii")
    assert names_of("broken.nhdr") == ["broken.nhdr"]
    assert names_of("absent") == ["absent"]


def test_slices_of_folders(monkeypatch: pytest.MonkeyPatch) -> None:
    """An earlier film beside the slices is none of them."""
    Path("slices").mkdir()
    Path("slices/I0001").write_bytes(bytes(128) + b"DICM")
    Path("slices/frame.png").write_bytes(b"\x89PNG" + bytes(124) + b"DICM")
    Path("slices/old").write_bytes(b"\x08\0\x05\0CS\x02\0x ")  # a slice without a mark
    Path("slices/notes.txt").write_bytes(b"notes")
    os.mkfifo("slices/pipe")  # which nobody writes to
    films = {"0.png": b"\x89PNG", "f.gif": b"GIF89a", "f.mp4": b"\0\0\0\x20ftyp", "f.mp4.json": b"{"}
    for name, start in films.items():
        Path("slices", name).write_bytes(start)
    assert names_of("slices") == ["I0001", "frame.png", "old", "slices"]
    if sys.platform == "linux":  # it is not read, for that could take without end
        Path("slices/kernel").symlink_to("/proc/version")
        assert "version" not in names_of("slices")
    with monkeypatch.context() as patch:  # what cannot be read may be one
        patch.setattr(Path, "open", mock.Mock(side_effect=PermissionError))
        assert "notes.txt" in names_of("slices")
    Path("slices/a.TIF").touch()
    assert names_of("slices") == ["a.TIF", "slices"]


def test_a_transfer_function_that_is_imported_is_an_input() -> None:
    Path("look.cmap").write_text("0 0 0\n1 1 1\n")
    Path("film.mp4.json").write_text(json.dumps([{"Name": "a", "RGBPoints": [0, 0, 0, 0, 9, 1, 1, 1]}]))
    colors: dict[str, object] = {"import": "look.cmap", "range": [0, 9], "opacity": [[0, 0], [9, 1]]}
    tree = small_tree(frames=2, transfer_function=colors)
    scene = parse_scene(tree, base=Path())
    assert [*scene_files(scene)] == [Path("look.cmap")]
    FilmJob(scene, [0, 1], accuracy_of(scene.error)).require_harmless()
    scene = parse_scene(tree | {"transfer_function": colors | {"import": "film.mp4.json"}}, base=Path())
    with pytest.raises(InputError, match="would overwrite an input"):
        FilmJob(scene, [0, 1], accuracy_of(scene.error)).require_harmless()
    preset = parse_scene(tree | {"transfer_function": {"import": "ct-bone"}}, base=Path())
    assert [*scene_files(preset)] == []
    Path("mask.npy").touch()
    Path("names.ctbl").touch()
    masked = parse_scene(tree | {"mask": {"file": "mask.npy", "names": "names.ctbl"}}, base=Path())
    assert {*scene_files(masked)} == {Path("look.cmap"), Path("mask.npy"), Path("names.ctbl")}
