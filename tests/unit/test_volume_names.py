"""Which volumes a command line means, and what their films are called."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dicom_files import image_fields, save

from hsplat_cli.scenes import base_name, expand_volumes, name_volumes
from renderer.errors import InputError
from renderer.job import expand_pattern

pytestmark = pytest.mark.usefixtures("folder")


def touch(*names: str) -> None:
    for name in names:
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).touch()


def names_of(*volumes: str) -> list[str]:
    return list(name_volumes([Path(volume) for volume in volumes]))


@pytest.mark.parametrize(
    ("volume", "name"),
    [
        ("scan.nrrd", "scan"), ("a/scan.nii.gz", "scan"), ("scan.v2.NII.GZ", "scan.v2"), ("series/", "series"),
        ("scan", "scan"), ("scan.2024", "scan.2024"), (".nrrd", "volume"), ("-x.npy", "_x"),
        ("..hidden.npy", "_hidden"), ("a{frame}\n.tif", "a_frame__"), ("Größe 数据.mha", "Größe 数据"),
    ],
)  # fmt: skip
def test_base_name(volume: str, name: str) -> None:
    assert base_name(Path(volume)) == name


def test_the_current_folder_has_a_name(tmp_path: Path) -> None:
    assert base_name(Path()) == tmp_path.name


@pytest.mark.parametrize(
    ("volumes", "names"),
    [
        (["a.nrrd", "b.nrrd"], ["a", "b"]),
        (["a/scan.nrrd", "b/scan.nrrd", "other.nrrd"], ["a_scan", "b_scan", "other"]),
        (["scan.nrrd", "scan.mha"], ["scan.nrrd", "scan.mha"]),
        (["x/a/scan.nrrd", "y/a/scan.nrrd"], ["x_a_scan", "y_a_scan"]),
        (["v/x/a/s.nrrd", "w/x/a/s.nrrd"], ["a_s", "a_s-2"]),
        (["Scan.nrrd", "b/scan.nrrd"], None),
        (["x/a/s.nrrd", "y/a/s.nrrd", "a_s-2.nrrd"], None),
        (["a/x.nrrd", "b/x.nrrd", "b/x.mha"], None),
    ],
)
def test_each_volume_has_a_name_of_its_own(volumes: list[str], names: list[str] | None) -> None:
    found = names_of(*volumes)
    assert len({name.lower() for name in found}) == len(volumes)
    assert names is None or found == names


def test_patterns_are_expanded_in_order() -> None:
    touch("b.npy", "a.npy", "sub/c.npy", "x.txt")
    assert expand_volumes(["*.npy", "a.npy"]) == ([Path("a.npy"), Path("b.npy")], [])
    assert expand_volumes(["**/*.npy"])[0] == [Path("a.npy"), Path("b.npy"), Path("sub/c.npy")]


@pytest.mark.parametrize("pattern", ["*.npy", "/nowhere/*.npy"])
def test_a_pattern_that_matches_nothing(pattern: str, tmp_path: Path) -> None:
    touch("scan.nrrd")
    volumes, notes = expand_volumes(["scan.nrrd", pattern])  # left, like what is not there, until its turn comes
    assert (volumes, notes) == ([Path("scan.nrrd"), Path(pattern)], [])
    expand_pattern(str(volumes[0]))
    with pytest.raises(InputError) as caught:
        expand_pattern(str(volumes[1]))
    hint = f"\n  hint: it is relative to {tmp_path}" if pattern == "*.npy" else ""
    assert str(caught.value) == f"{pattern}: no file matches this pattern{hint}"


def test_a_name_that_looks_like_a_pattern() -> None:
    touch("scan[1].npy", "scan1.npy")
    assert expand_volumes(["scan[1].npy"])[0] == [Path("scan[1].npy")]
    expand_pattern("scan[1].npy")


def test_data_files_are_left_out_beside_their_headers() -> None:
    np.zeros((2, 2, 2), np.uint8).tofile("engine.raw")
    Path("engine.nhdr").write_text(
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: engine.raw\n", encoding="ascii"
    )
    touch("alone.raw")
    for name in ("pair.hdr", "pair.img"):
        Path(name).write_bytes(b"\0")
    volumes, notes = expand_volumes(["*"])
    assert volumes == [Path("alone.raw"), Path("engine.nhdr"), Path("pair.hdr")]
    assert notes == ["engine.raw is the data of engine.nhdr", "pair.img is the data of pair.hdr"]
    assert expand_volumes(["engine.raw"]) == ([Path("engine.raw")], [])


def test_a_folder_of_volumes_stands_for_all_below_it() -> None:
    touch("in/b.npy", "in/a.nii.gz", "in/notes.txt", "in/.hidden", "in/stack/1.tif", "in/text/notes.txt")
    touch("in/deep/10/c.npy", "in/deep/2/c.npy", "in/.trash/c.npy", "in/deep/2/stack/1.tif", "in/deep/2/stack/2.tif")
    np.zeros((2, 2, 2), np.uint8).tofile("in/c.raw")
    header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: c.raw\n"
    Path("in/c.nhdr").write_text(header, encoding="ascii")
    volumes, notes = expand_volumes(["in/b.npy", "in"])
    below = ["deep/2/c.npy", "deep/2/stack", "deep/10/c.npy"]
    assert volumes == [Path("in", name) for name in ("b.npy", "a.nii.gz", "c.nhdr", *below, "stack")]
    assert notes == ["in: its volumes are drawn; left out: notes.txt, text"]


def test_links_in_a_folder_are_followed_once(tmp_path: Path) -> None:
    for name in ("a.npy", "b.npy"):
        np.save(tmp_path / name, np.zeros((2, 2, 2)))
    for name, target in {"c.npy": "a.npy", "self.npy": "self.npy", "folder.npy": ".", "gone.npy": "none.npy"}.items():
        (tmp_path / name).symlink_to(target)
    volumes, notes = expand_volumes([str(tmp_path)])
    assert volumes == [tmp_path / "a.npy", tmp_path / "b.npy"]
    assert notes == [f"{tmp_path}: its volumes are drawn; left out: folder.npy, gone.npy, self.npy"]
    itself = str(tmp_path / "self.npy")
    assert expand_volumes([itself]) == ([Path(itself)], [])


def test_other_folders_are_volumes_themselves() -> None:
    """With one volume, which is found by its reader, with slices, or with nothing."""
    touch("one/sub/a.npy", "slices/1.tif", "slices/a.npy", "slices/b.npy")
    Path("empty").mkdir()
    folders = ["one", "slices", "empty"]
    assert expand_volumes(folders) == ([Path(folder) for folder in folders], [])


def test_a_header_whose_data_are_gone_is_left_to_its_reader() -> None:
    Path("engine.nhdr").write_text("NRRD0004\nencoding: raw\ndata file: gone.raw\n", encoding="ascii")
    assert expand_volumes(["*"]) == ([Path("engine.nhdr")], [])


def test_the_folder_stands_for_slices_one_by_one() -> None:
    """Of one series; others are volumes of their own."""
    for folder, name, uid in (("a", "1", "1.2"), ("a", "2", "1.2"), ("a", "3", "1.3"), ("b", "1", "1.2")):
        Path(folder).mkdir(exist_ok=True)
        save(Path(folder, name), image_fields(np.zeros((4, 5), np.uint8), uid=uid))
    np.save("c.npy", np.zeros((2, 2, 2)))
    volumes, notes = expand_volumes(["c.npy", "a/*", "b/1"])
    assert volumes == [Path(name) for name in ("c.npy", "a", "a/3", "b/1")]
    assert notes == ["2 files of a are slices of one volume: the folder is drawn"]
    assert expand_volumes(["a/*.dcm", "a/?.dcm"])[0] == [Path("a/*.dcm"), Path("a/?.dcm")]  # which are no files
