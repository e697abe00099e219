"""Several files of one drawing: what each format keeps, and that all of them are made, found and made again."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import contents, small_tree

import renderer
from hsplat_cli import main
from renderer.film import decode_exr, decode_known_film, decode_png, quantize, reduce_radiance
from renderer.scene import FORMATS, OutputFile, parse_scene

NUM_FRAMES, SIDE = 6, 48
# The last two frames are equal.
PATH = [{"type": "turntable", "frames": 4, "elevation": 20}, {"type": "hold", "frames": 2}]
EXACT = {"file": "exact/{frame}.exr", "size": [SIDE, SIDE], "background": "transparent"}
GRADIENT = {"top": "#204060", "bottom": "white"}
ENCODED = [
    {"file": f"{name}-{'clear' if background == 'transparent' else 'solid'}{suffix}", "codec": name, "quality": 9}
    | {"background": background}
    for suffix, each in FORMATS.items()
    for name, codec in each.codecs.items()
    for background in [GRADIENT, *["transparent"] * bool(codec.with_alpha)]
]
LIST: list[dict[str, Any]] = [
    {"file": "film.mp4", "size": [SIDE, SIDE]},
    {"file": "film.webm", "background": "transparent"},
    {"file": "film.gif", "size": [SIDE // 2, SIDE // 2], "every": 2},
    {"file": "poster.png", "frame": 3, "pixel_format": "rgb48"},
    {"file": "small/{frame}.png", "size": [SIDE // 3, SIDE // 3], "every": 3},
]


def scene_of(outputs: Any, **sections: Any) -> renderer.Scene:
    return parse_scene(small_tree(camera={"path": PATH}, output=outputs, **sections), base=Path())


@pytest.fixture(scope="module")
def formats(module_folder: Path) -> renderer.Scene:
    """A film in every format and codec, opaque and transparent, beside its exact pictures."""
    scene = scene_of([EXACT, *ENCODED])
    renderer.render(scene)
    return scene


def exact(frame: int) -> np.ndarray:
    """Premultiplied RGBA, as it was composited: float32 [h, w, 4]."""
    return decode_exr(Path(f"exact/{frame}.exr").read_bytes())


def psnr(one: np.ndarray, other: np.ndarray) -> float:
    """Of all channels, with colours as far as alpha shows them."""
    first, second = (each / np.iinfo(each.dtype).max for each in (one, other))
    for each in (first, second):
        each[..., :3] *= each[..., 3:] if each.shape[2] == 4 else 1
    error = np.mean((first - second) ** 2)
    return math.inf if error == 0 else -10 * math.log10(error)


@pytest.mark.parametrize("number", range(len(ENCODED)), ids=[each["file"] for each in ENCODED])
def test_each_format_keeps_the_pictures(formats: renderer.Scene, number: int) -> None:
    """Alpha, the gradient behind the object, 16 bits where there are as many, and frames that are equal."""
    output = formats.output.others[number]
    background, depth = output.kind.background, output.kind.depth
    drawn = [quantize(exact(frame), background, depth) for frame in range(NUM_FRAMES)]
    assert np.array_equal(drawn[4], drawn[5])
    assert len(np.unique(drawn[0].reshape(-1, drawn[0].shape[2]), axis=0)) > SIDE
    with decode_known_film(output, NUM_FRAMES) as found:
        kept = [psnr(picture, each) for picture, each in zip(found, drawn, strict=True)]
    usual, _ = output.chosen_codec.kept_psnr
    assert min(kept) > (99 if usual == 100 else 0.75 * usual), kept


@pytest.mark.parametrize("suffix", [suffix for suffix, each in FORMATS.items() if each.codecs])
def test_a_film_of_one_frame(folder: Path, suffix: str) -> None:
    background = "transparent" if FORMATS[suffix].has_alpha else "black"
    scene = scene_of([EXACT, {"file": f"still{suffix}", "background": background, "frame": 2, "quality": 10}])
    renderer.render(scene)
    output = scene.output.others[0]
    with decode_known_film(output, 1) as found:
        (picture,) = found
    assert psnr(picture, quantize(exact(2), output.background, output.kind.depth)) > 35


def test_files_of_one_drawing(folder: Path) -> None:
    """Each file has the bytes that it has alone; pixels of smaller ones are means of exact pictures."""
    renderer.render(scene_of([*LIST, EXACT]))
    together = contents()
    for each in (LIST[0], LIST[1] | {"size": [SIDE, SIDE]}):
        renderer.render(scene_of(each | {"file": f"alone/{each['file']}"}))
        assert Path("alone", each["file"]).read_bytes() == together[Path(each["file"])]
    for frame in (0, 3):
        small = quantize(reduce_radiance(exact(frame), 3), (0.0, 0.0, 0.0), 8)
        assert np.array_equal(decode_png(Path(f"small/{frame}.png").read_bytes()), small)
    assert np.array_equal(decode_png(Path("poster.png").read_bytes()), quantize(exact(3), (0.0, 0.0, 0.0), 16))
    gif = OutputFile(Path("film.gif"), (SIDE // 2, SIDE // 2), frames_per_second=15)
    with decode_known_film(gif, NUM_FRAMES // 2) as pictures:
        means = [quantize(reduce_radiance(exact(frame), 2), (0.0, 0.0, 0.0), 8) for frame in (0, 2, 4)]
        assert all(psnr(one[..., :3], other) > 40 for one, other in zip(pictures, means, strict=True))


class StoppedError(Exception):
    pass


@pytest.mark.slow
def test_a_list_is_resumed_found_and_made_again(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = scene_of(LIST, annotation={"time": "{frame}"})
    renderer.render(scene)
    files = {path: content for path, content in contents().items() if path.suffix != ".json"}
    assert len(files) == 6
    calls: list[int] = []
    renderer.render(scene, on_progress=lambda done, of: calls.append(done))
    assert calls == []  # it is up to date
    for path in (Path("film.gif"), Path("small/3.png")):
        path.write_bytes(files[path][:-1] + b"!")
        assert main.run(["verify", "film.mp4", "--quiet"]) == 1
        assert str(path) in capsys.readouterr().out
        renderer.render(scene)
        assert path.read_bytes() == files[path]
    for path in contents():
        path.unlink()

    def stop(done: int, of: int) -> None:
        if done == 2:
            raise StoppedError

    with pytest.raises(StoppedError):
        renderer.render(scene, on_progress=stop)
    assert not any(path in contents() for path in files if path.parent != Path("small"))
    renderer.render(scene, on_progress=lambda done, of: calls.append(of))
    assert 0 < calls[0] < NUM_FRAMES
    assert {path: content for path, content in contents().items() if path.suffix != ".json"} == files
    assert main.run(["verify", "film.mp4", "--quiet"]) == 0
