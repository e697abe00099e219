"""Reports are read from folders and archives that anybody may have edited."""

from __future__ import annotations

import os
import shutil
import stat
import struct
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hsplat_cli.compare import (
    REPORT,
    ComparedFilm,
    ComparedFrame,
    Comparison,
    ReportPicture,
    open_reports,
    read_report,
    read_report_picture,
)
from renderer.errors import InputError

PICTURE = "films/0/new/frame-0000.png"
FRAME = ComparedFrame("a", "new", "no golden", new=ReportPicture("0" * 32, PICTURE))
COMPARISON = Comparison((ComparedFilm("a", "same bytes", frames=(FRAME,)),))
CONTENT = REPORT.content(COMPARISON)


def archive(path: Path, *entries: tuple[str | zipfile.ZipInfo, bytes], method: int = zipfile.ZIP_DEFLATED) -> Path:
    """Write an archive of a report, with further entries."""
    with zipfile.ZipFile(path, "w", method) as file:
        file.writestr("report.json", CONTENT)
        for name, content in entries:
            file.writestr(name, content)
    return path


def picture(path: Path, name: str = PICTURE) -> bytes:
    with open_reports(path) as (source,):
        assert read_report(source) == COMPARISON
        return read_report_picture(source, name)


def refusal(path: Path, name: str = PICTURE) -> str:
    with pytest.raises(InputError) as caught:
        picture(path, name)
    return str(caught.value)


def entry(name: str, mode: int = stat.S_IFREG | 0o644) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name)
    info.external_attr = mode << 16
    return info


def write_folder(path: Path) -> Path:
    (path / PICTURE).parent.mkdir(parents=True)
    (path / PICTURE).write_bytes(b"a picture")
    (path / "report.json").write_bytes(CONTENT)
    return path


def test_folders_and_archives_of_them_are_read(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "report")
    assert picture(folder) == picture(folder / "report.json") == b"a picture"
    for root in (folder, tmp_path):  # some CI systems keep the folders above a report
        path = tmp_path.parent / f"{tmp_path.name}-{root.name}.zip"
        with zipfile.ZipFile(path, "w") as file:
            for each in folder.rglob("*"):
                file.write(each, each.relative_to(root))
        assert picture(path) == b"a picture"


@pytest.mark.parametrize(
    "name",
    [
        "junit.xml",
        "/etc/passwd",
        "films/0/new/../../../secret.png",
        "films/../films/0/new/frame-0000.png",
        "films/0/new/deep/frame-0000.png",
        "films/0/new/a\\b.png",
        "films/0/new/.png",
        "films/0/new/frame-0000.png\n",
        "films/x/new/frame-0000.png",
        "./films/0/new/frame-0000.png",
        f"films/0/new/{'x' * 300}.png",
    ],
)
def test_names_that_no_report_has(tmp_path: Path, name: str) -> None:
    (tmp_path / "secret.png").write_bytes(b"mine")
    for path in (write_folder(tmp_path / "report"), archive(tmp_path / "report.zip")):
        assert "not a picture of a report" in refusal(path, name)


def test_links_in_folders_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/frame-0000.png").write_bytes(b"mine")
    for place, target in ((PICTURE, "mine/frame-0000.png"), ("films/0/new", "mine")):
        folder = write_folder(tmp_path / target.replace("/", "-"))
        (folder / PICTURE).unlink()
        if not (folder / place).is_dir():
            (folder / place).symlink_to(tmp_path / target)
        else:
            (folder / place).rmdir()
            (folder / place).symlink_to(tmp_path / target)
        assert "a link in a report" in refusal(folder)


@pytest.mark.parametrize(
    ("mode", "name"),
    [
        (stat.S_IFLNK | 0o777, PICTURE),
        (stat.S_IFIFO | 0o644, PICTURE),
        (stat.S_IFCHR | 0o644, PICTURE),
        (stat.S_IFDIR | 0o755, f"{PICTURE}/"),
    ],
)
def test_entries_that_are_no_files(tmp_path: Path, mode: int, name: str) -> None:
    path = archive(tmp_path / "report.zip", (entry(name, mode), b"/etc/passwd"))
    assert "in this report" in refusal(path)


def test_other_compressions_are_refused(tmp_path: Path) -> None:
    """The memory that LZMA takes is what the archive says."""
    info = entry(PICTURE)
    info.compress_type = zipfile.ZIP_LZMA
    path = archive(tmp_path / "report.zip")
    with zipfile.ZipFile(path, "a") as file:
        file.writestr(info, b"x", zipfile.ZIP_LZMA)
    assert "not a plain file" in refusal(path)


def edited(path: Path, edit: Callable[[bytearray, int, int], object]) -> Path:
    """Edit the bytes of an archive of one picture; the function gets the places of its two headers, too."""
    archive(path, (entry(PICTURE), bytes(1000)))
    data = bytearray(path.read_bytes())
    local = data.index(PICTURE.encode()) - 30
    central = data.rindex(PICTURE.encode()) - 46
    edit(data, local, central)
    path.write_bytes(data)
    return path


def test_encrypted_entries(tmp_path: Path) -> None:
    def encrypt(data: bytearray, local: int, central: int) -> None:
        data[local + 6] |= 1
        data[central + 8] |= 1

    assert "not a plain file" in refusal(edited(tmp_path / "report.zip", encrypt))


@pytest.mark.parametrize("size", [2**28 + 1, 2**32 - 2])
def test_a_huge_size_in_the_header_takes_no_memory(tmp_path: Path, size: int) -> None:
    def enlarge(data: bytearray, local: int, central: int) -> None:
        struct.pack_into("<I", data, central + 24, size)
        struct.pack_into("<I", data, local + 22, size)

    assert "too large a file" in refusal(edited(tmp_path / "report.zip", enlarge))


def test_a_bomb_is_read_no_further_than_its_header_says(tmp_path: Path) -> None:
    """The header says 1000 bytes, the data has 64 MiB."""
    path = archive(tmp_path / "report.zip", (entry(PICTURE), bytes(2**26)))
    data = bytearray(path.read_bytes())
    struct.pack_into("<I", data, data.rindex(PICTURE.encode()) - 46 + 24, 1000)
    path.write_bytes(data)
    tracemalloc.start()
    try:
        assert "a damaged file" in refusal(path)
        assert tracemalloc.get_traced_memory()[1] < 2**24
    finally:
        tracemalloc.stop()


def test_a_bomb_of_an_outcome(tmp_path: Path) -> None:
    path = tmp_path / "report.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("report.json", b"{" + b'"a":[' * 200_000)
    assert "report.json" in refusal(path)


def test_damaged_data(tmp_path: Path) -> None:
    def spoil(data: bytearray, local: int, central: int) -> None:
        data[central + 16] ^= 1  # the checksum

    assert "a damaged file" in refusal(edited(tmp_path / "report.zip", spoil))


def test_equal_names(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="Duplicate name"):
        path = archive(tmp_path / "report.zip", (PICTURE, b"one"), (PICTURE, b"other"))
    assert f"an archive with two files {PICTURE}" in refusal(path)


def test_too_many_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = archive(tmp_path / "report.zip", (PICTURE, b"one"))
    monkeypatch.setattr("hsplat_cli.compare.report_source._MAX_ENTRIES", 1)
    text = refusal(path)
    assert "got: an archive of 2 files" in text and "expected: at most 1" in text


def test_an_artifact_may_have_several_reports(tmp_path: Path) -> None:
    """And other files beside them. A folder with a report of its own is that report alone."""
    for name in ("one", "two/deep"):
        write_folder(tmp_path / "all" / name)
    (tmp_path / "all/log.txt").touch()
    shutil.make_archive(str(tmp_path / "all"), "zip", tmp_path / "all")
    for place in ("all", "all.zip"):
        with open_reports(tmp_path / place) as reports:
            assert [each.path for each in reports] == [tmp_path / place / "one", tmp_path / place / "two/deep"]
            assert all(read_report(each) == COMPARISON and read_report_picture(each, PICTURE) for each in reports)
    write_folder(tmp_path / "all/one/below")
    with open_reports(tmp_path / "all/one") as (only,):
        assert only.path == tmp_path / "all/one"


@pytest.mark.parametrize("root", ["", "report/"])
@pytest.mark.parametrize("name", ["a.txt", "films/0/new/frame-0001.png", "films/0/old/frame-0000.png", "x/report.json"])
def test_an_archive_with_files_that_the_report_does_not_name_is_refused(root: str, name: str, tmp_path: Path) -> None:
    path = tmp_path / "report.zip"
    for others in ([], [name]):
        with zipfile.ZipFile(path, "w") as file:
            for each in ("report.json", "index.html", PICTURE, *others):
                file.writestr(f"{root}{each}", CONTENT)
            file.writestr("report.txt" if root else "films/", "")
        with open_reports(path) as (source, *_):
            if not others:
                assert read_report(source) == COMPARISON
                continue
            with pytest.raises(InputError, match="somebody edited this archive") as caught:
                read_report(source)
            assert caught.value.got == name


def test_places_without_a_report(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "none.zip", "w"):
        pass
    assert "no report in this archive" in refusal(tmp_path / "none.zip")
    text = refusal(tmp_path)
    assert "no report in this folder" in text and "hint: give that folder, or a ZIP archive of it" in text


END = b"PK\x05\x06"


@pytest.mark.parametrize("content", [b"", b"PK", b"no archive", END + b"\xff" * 18])
def test_files_that_are_no_archives(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "report.zip"
    path.write_bytes(content)
    assert "not a report" in refusal(path)


def test_places_that_are_no_reports(tmp_path: Path) -> None:
    assert "no such report" in refusal(tmp_path / "nowhere")
    os.mkfifo(tmp_path / "pipe")
    assert "not a file" in refusal(tmp_path / "pipe")


def test_every_damage_to_an_archive_is_told(tmp_path: Path) -> None:
    """Cut off anywhere, or with any byte changed, it is read as before, or refused."""
    path = archive(tmp_path / "report.zip", (PICTURE, b"a picture"))
    whole, random = path.read_bytes(), np.random.default_rng(1)
    num_refused = 0
    for place in range(len(whole)):
        damaged = bytearray(whole)
        damaged[place] ^= int(random.integers(1, 256))
        for content in (whole[:place], bytes(damaged)):
            path.write_bytes(content)
            try:
                assert picture(path) == b"a picture"
            except InputError:
                num_refused += 1
    assert num_refused > len(whole)
