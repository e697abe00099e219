"""A scene that is edited while its page is open: what the page gets, and who may have it."""

from __future__ import annotations

import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from small_scene import small_scene

from hsplat_cli.preview import file_states, served_states, watch
from hsplat_cli.preview.watch import State
from hsplat_cli.scenes import SceneRequest

SCENE = Path("scene.yaml")


def test_edits_are_shown(folder: Path) -> None:
    """Pictures become finer; a mistake is shown beside the last good picture; a file that vanishes is waited for."""
    right = small_scene(error="tolerance: 0.1")
    edits = [right.replace("0.7", "0.2"), right.replace("opacity", "opacty"), right, None, right.replace("255", "200")]
    states: list[list[State]] = [[]]

    def keeps_on() -> bool:
        if states[-1] and not edits:
            return False
        if states[-1]:
            states.append([])
            if (text := edits.pop(0)) is None:
                SCENE.unlink()
            else:
                SCENE.write_text(text, "utf-8")
        return True

    def show(state: State) -> None:
        states[-1].append(state)

    SCENE.write_text(right, "utf-8")
    watch(SceneRequest(SCENE), show, keeps_on)
    numbers = [state.number for each in states for state in each]
    assert numbers == [*range(1, len(numbers) + 1)]
    first, fainter, wrong, again, gone, last = states
    assert [state.shot.caption.split(",")[0] for state in first if state.shot] == [
        f"frame 0 at tolerance {tolerance}" for tolerance in (1, 0.3, 0.1)
    ]
    drawn = [each[-1].shot for each in (first, fainter, again)]
    assert all(drawn) and np.array_equal(drawn[0].pixels, drawn[2].pixels)
    assert not np.array_equal(drawn[0].pixels, drawn[1].pixels)
    assert len(wrong) == 1 and "scene.yaml:4:" in wrong[0].error and "did you mean opacity?" in wrong[0].error
    assert wrong[0].shot is fainter[-1].shot
    assert not again[-1].error
    assert "no such file" in gone[0].error and not last[-1].error


def test_a_large_volume_shows_some_voxels_first(folder: Path) -> None:
    """Only where its layer is made again, and then all."""
    large = small_scene(shape="136, 9, 9", error="tolerance: 0.1")
    edits, shown = [large.replace("elevation: 20", "elevation: 40"), large.replace("0.7", "0.2")], [list[bool]()]

    def keeps_on() -> bool:
        if shown[-1] and edits:
            SCENE.write_text(edits.pop(0), "utf-8")
            shown.append([])
        return bool(edits) or not shown[-1]

    def show(state: State) -> None:
        assert state.shot is not None
        shown[-1].append("some of the voxels" in state.shot.caption)

    SCENE.write_text(large, "utf-8")
    watch(SceneRequest(SCENE), show, keeps_on)
    assert shown == [[False] * 3, [False] * 3, [True, False, False]]


def test_only_who_has_the_address_is_served() -> None:
    with served_states("<b>scene") as (address, show):
        show(State(7, error="wrong"))
        with urllib.request.urlopen(address) as page:
            assert b"&lt;b&gt;scene" in page.read()
        with urllib.request.urlopen(f"{address}events") as events:
            assert events.readline() == b'data: {"number": 7, "error": "wrong"}\n'
        server = address.rsplit("/", 2)[0]
        other = {"Host": "example.org"}
        for wrong in (f"{server}/", f"{server}/x/", f"{address}x", urllib.request.Request(address, headers=other)):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                urllib.request.urlopen(wrong)


def test_a_page_from_a_file_has_its_states_beside_it(folder: Path) -> None:
    with file_states(Path("page.html"), "</script>", []) as show:
        show(State(1, error="</script>"))
    assert Path("page.html").read_text("utf-8").count("</script>") == 1
    assert Path("page.html.js").read_text("utf-8") == '// by hsplat\nshow({"number": 1, "error": "</script>"});\n'
