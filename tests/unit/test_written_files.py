"""Files that a job writes are told apart by the places that their names lead to, before anything is written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from renderer.errors import InputError
from renderer.film import WrittenFiles

pytestmark = pytest.mark.usefixtures("folder")

SAME = "two outputs are one file"
UNFINISHED = "in a folder for unfinished frames"
FOLDER = "the folder of another one"


def link(name: str, target: str) -> Callable[[], None]:
    return lambda: Path(name).symlink_to(target)


def nothing() -> None: ...


@pytest.mark.parametrize(
    ("make", "names", "what"),
    [
        (nothing, ["a.mp4", "./a.mp4"], SAME),
        (nothing, ["a.mp4", "new/../a.mp4"], SAME),
        (nothing, ["new/a.mp4", "new/deep/../a.mp4"], SAME),
        (nothing, ["film.png", "Film.PNG"], SAME),
        (nothing, ["caf\u00e9.png", "cafe\u0301.png"], SAME),
        (link("here", "."), ["a.mp4", "here/a.mp4"], SAME),
        (link("here", "new"), ["new/a.mp4", "here/a.mp4"], SAME),
        (link("b.mp4", "a.mp4"), ["a.mp4", "b.mp4"], SAME),
        (nothing, ["a.mp4", "a.mp4/b.png"], FOLDER),
        (nothing, ["a.mp4.json/b.png", "a.mp4.json"], FOLDER),
        (link("here", "a.mp4"), ["a.mp4", "here/deep/b.png"], FOLDER),
        (nothing, ["a.mp4.unfinished/b.png"], UNFINISHED),
        (nothing, ["other.mp4.Unfinished/deep/b.png"], UNFINISHED),
        (link("here", "a.mp4.unfinished"), ["here/b.png"], UNFINISHED),
    ],
)
def test_files_that_would_harm_each_other(make: Callable[[], None], names: list[str], what: str) -> None:
    make()
    with pytest.raises(InputError, match=what) as error:
        WrittenFiles([*map(Path, names)]).require_harmless([])
    assert error.value.where in names


@pytest.mark.parametrize(
    "names", [["a.mp4", "b.mp4"], ["a.mp4", "a.mp4.json", "a.mp4.d/b.png"], ["one/a.png", "two/a.png"]]
)
def test_files_that_are_apart(names: list[str]) -> None:
    WrittenFiles([*map(Path, names)], [Path("a.mp4.unfinished")]).require_harmless([])


def test_two_names_of_one_file_are_replaced_each_on_its_own() -> None:
    """Outputs are renamed to their names, so that hard links, as tools make them of equal frames, are no harm."""
    Path("0.png").touch()
    Path("1.png").hardlink_to("0.png")
    WrittenFiles([Path("0.png"), Path("1.png")]).require_harmless([])


def test_unfinished_work_that_is_an_input() -> None:
    Path("b.png.unfinished").mkdir()
    scan = Path("b.png.unfinished/scan.npy")
    scan.touch()
    written = WrittenFiles([Path("a.mp4")], [Path("a.mp4.unfinished"), Path("b.png.unfinished")])
    written.require_harmless([Path("elsewhere.npy")])
    with pytest.raises(InputError, match="would overwrite an input"):
        written.require_harmless([scan])
