"""Draw the pictures of docs/gallery.md from the scenes on it: `python gallery_page.py [NAME ...]`, by default all.

Above each scene, write what its picture cost.
"""

from __future__ import annotations

import json
import os
import re
import sys
from pathlib import Path

from renderer import load_scene, render

PAGE = Path(__file__).resolve().parents[2] / "docs" / "gallery.md"
PICTURES = PAGE.with_name("gallery")
# The name of a picture, the sentence on it, and its scene; the cost of the picture may be between these two.
_ENTRY = re.compile(r"\]\(gallery/(\w+)\.webp\)\n\n(.*?)\n\n(?:\*[^*]*\*\n\n)?```yaml\n(.*?)```", re.DOTALL)


def gallery_scenes() -> dict[str, str]:
    """Return the scenes of the page by the names of their pictures."""
    return {name: scene for name, _, scene in _ENTRY.findall(PAGE.read_text("utf-8"))}


def draw(name: str, scene: str) -> str:
    """Draw a picture in the current folder, leave nothing else, and return what it cost."""
    file = Path(f"{name}.yaml")
    file.write_text(scene, "utf-8")
    film = render(load_scene(file), resume=False)
    seconds = json.loads(film.sidecar.read_text("utf-8"))["seconds"]["total"]
    file.unlink()
    film.sidecar.unlink()
    assert film.accuracy is not None, "scenes of the page do not turn probes off"
    return f"{seconds:.1f} s, {film.accuracy.psnr:.1f} dB"


def main(names: list[str]) -> None:
    """Draw pictures, and write the cost of each into the page as soon as it is drawn."""
    PICTURES.mkdir(exist_ok=True)
    os.chdir(PICTURES)
    scenes = gallery_scenes()
    for name in names or scenes:
        cost = draw(name, scenes[name])
        print(f"{name}: {cost}, {Path(f'{name}.webp').stat().st_size} bytes", flush=True)
        entry = f"]({PICTURES.name}/{name}.webp)\n\n\\2\n\n*{cost}*\n\n```yaml\n\\3```"
        pattern = re.compile(_ENTRY.pattern.replace(r"(\w+)", f"({name})"), re.DOTALL)
        PAGE.write_text(pattern.sub(entry, PAGE.read_text("utf-8")), "utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
