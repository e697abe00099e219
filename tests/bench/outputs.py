"""What do further files and annotation cost? `python tests/bench/outputs.py DATA` writes the page of it.

Processor time of this process and its encoders, for films of suggested scenes. The page is docs/benchmarks/outputs.md.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from measuring import PAGES, machine_line, medians_in_turns, parser_of, section, suggested, write_page

import renderer
from renderer.film import Picture, decode_png, frame_path, open_films
from renderer.scene import Scene, parse_scene, scene_to_dict

PAGE = PAGES / "outputs.md"
SUBJECTS = ("engine, CT", "bonsai, CT", "head, T1 of CIT168")
SIZE, FRAMES, REPEATS = 512, 40, 3
ANNOTATION = {"title": "A title"} | dict.fromkeys(("time", "color_bar", "scale_bar", "accuracy", "orientation"), True)
COLUMNS = "film | one file, s | three, s | encoders of two alone, s | three / (one + encoders) | annotated / one"


def with_outputs(scene: Scene, outputs: list[dict[str, object]], **sections: object) -> Scene:
    return parse_scene(scene_to_dict(scene) | {"output": outputs} | sections, base=Path())


def processor_seconds() -> float:
    return sum(os.times()[:4])


def works_of(scene: Scene, folder: Path) -> list[Callable[[], object]]:
    """Return a film, the film in three files, the encoders of the other two, and the film with annotation."""
    first: dict[str, object] = {"file": str(folder / "one.mp4"), "size": [SIZE, SIZE]}
    clear: dict[str, object] = {"background": "transparent", "file": str(folder / "two.webm")}
    small: dict[str, object] = {"size": [SIZE // 2, SIZE // 2], "file": str(folder / "three.gif")}
    frames = [each | {"file": str(folder / f"{k}-{{frame}}.png")} for k, each in enumerate((first, clear, small))]
    renderer.render(with_outputs(scene, frames))
    pictures = [
        {k: Picture(decode_png(frame_path(Path(str(frames[k + 1]["file"])), n).read_bytes())) for k in (0, 1)}
        for n in range(FRAMES)
    ]
    others = with_outputs(scene, [first, clear, small]).output.others
    kinds = [each.kind for each in others]

    def encode() -> None:
        with open_films(others, kinds) as write:
            for number, each in enumerate(pictures):
                write(number, each)

    one, three = with_outputs(scene, [first]), with_outputs(scene, [first, clear, small])
    annotated = with_outputs(scene, [first], annotation=ANNOTATION)
    return [
        lambda: renderer.render(one, resume=False),
        lambda: renderer.render(three, resume=False),
        encode,
        lambda: renderer.render(annotated, resume=False),
    ]


def main() -> None:
    """Measure, and write the page."""
    data = parser_of(__doc__).parse_args().data
    lines = [machine_line(), ""]
    text = f"{FRAMES} frames of {SIZE} x {SIZE} pixels, suggested scenes at their tolerance, exact rays included."
    lines += section("Several files of one drawing, and annotation", text, COLUMNS)
    for name in SUBJECTS:
        scene = suggested(data, name, (SIZE, SIZE), num_frames=FRAMES)
        with tempfile.TemporaryDirectory() as folder:
            works = works_of(scene, Path(folder))
            one, three, encoders, annotated = medians_in_turns(works, REPEATS, processor_seconds)
        ratios = f"{three / (one + encoders):.3f} | {annotated / one:.3f}"
        lines.append(f"| {name} | {one:.2f} | {three:.2f} | {encoders:.2f} | {ratios} |")
    write_page(PAGE, lines)


if __name__ == "__main__":
    main()
