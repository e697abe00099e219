"""Draw every entry of an annotation, and a loop in every format, on one page: `python figure_page.py FOLDER`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import yaml

import renderer
from renderer.film import encode_png
from renderer.scene import FORMATS, parse_scene

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
SIZES = ((256, 256), (512, 512), (720, 1280), (1280, 720), (1920, 1080))
BACKGROUNDS = {"dark": {"top": "#20303f", "bottom": "#050608"}, "light": {"top": "#ffffff", "bottom": "#d8e0e8"}}
LABELS = {"names": {number: f"organ {number}" for number in range(1, 6)}, "show": [1, 2, 3, 4, 5]}
ANNOTATION = {
    "title": "Heart", "time": "{volume.procedural.phase:.2f}", "color_bar": {"label": "density"}, "scale_bar": True,
    "accuracy": True, "orientation": True, "bounds": True,
}  # fmt: skip
STYLE = """body {font: 16px sans-serif; margin: 2em} figure {display: inline-block; margin: 1em}
img, video {max-width: 95vw; vertical-align: top} img + img, video + video {background: black}"""


def scene_of(name: str, **sections: Any) -> renderer.Scene:
    """Return a scene of `configs/` with other sections."""
    written = yaml.safe_load((CONFIGS / f"{name}.yaml").read_text(encoding="utf-8"))
    return parse_scene(written | sections, base=CONFIGS)


def draw_stills(folder: Path) -> list[str]:
    """Draw both scenes in all sizes, over a dark and a light background; return the elements of the page."""
    heart = scene_of("heart", annotation=ANNOTATION)
    atlas = scene_of("atlas", labels=LABELS, annotation={"legend": True, "title": {"text": "Organs", "color": "red"}})
    found = []
    for scene_name, scene in (("heart", heart), ("atlas", atlas)):
        for (width, height), (name, background) in ((size, each) for size in SIZES for each in BACKGROUNDS.items()):
            file = f"{scene_name}-{name}-{width}x{height}.png"
            image = renderer.render_frame(scene, frame=7, size=(width, height), background=background)
            (folder / file).write_bytes(encode_png(image))
            found.append(_figure(file))
    return found


def draw_loops(folder: Path) -> list[str]:
    """Draw one loop, and make it in every format and codec, transparent where that is possible."""
    outputs = [{"file": str(folder / "first.mp4"), "size": [256, 256], "frames_per_second": 25}]
    for suffix, each in FORMATS.items():
        for name, codec in (each.codecs or {"frame": None}).items():
            frames = {"codec": name} if codec else {"frame": 0}
            alpha = {"background": "transparent"} if codec is None or codec.with_alpha else {}
            outputs.append({"file": str(folder / f"{name}{suffix}"), **frames, **alpha})
    renderer.render(scene_of("heart", annotation={"time": True, "orientation": True}, output=outputs))
    return [_figure(Path(each["file"]).name, times=1 + ("background" in each)) for each in outputs]


def _figure(file: str, times: int = 1) -> str:
    """Return a file as an element; of two, the second one is over black."""
    shown = f'<img src="{file}">'
    if file.endswith((".mp4", ".webm", ".mov")):
        shown = f'<video src="{file}" autoplay loop muted></video>'
    return f"<figure>{shown * times}<figcaption>{file}</figcaption></figure>"


def main(folder: Path) -> None:
    """Write the page and what it shows."""
    folder.mkdir(parents=True, exist_ok=True)
    elements = draw_loops(folder) + draw_stills(folder)
    page = f"<!DOCTYPE html><meta charset=utf-8><title>Figures</title><style>{STYLE}</style>{''.join(elements)}"
    (folder / "index.html").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
