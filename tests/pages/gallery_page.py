"""Draw the pictures of docs/gallery.md from the scenes on it: `python gallery_page.py [NAME ...]`, by default all."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

from renderer import load_scene, render

PAGE = Path(__file__).resolve().parents[2] / "docs" / "gallery.md"
PICTURES = PAGE.with_name("gallery")


def gallery_scenes() -> dict[str, str]:
    """Return the scenes of the page by the names of their pictures."""
    found = re.findall(r"\]\(gallery/(\w+)\.webp\).*?```yaml\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    return dict(found)


def main(names: list[str]) -> None:
    """Draw pictures, and leave nothing else."""
    PICTURES.mkdir(exist_ok=True)
    os.chdir(PICTURES)
    scenes = gallery_scenes()
    for name in names or scenes:
        file = Path(f"{name}.yaml")
        file.write_text(scenes[name], "utf-8")
        film = render(load_scene(file), resume=False)
        print(film.path, film.accuracy and round(film.accuracy.psnr, 1), film.path.stat().st_size)
        file.unlink()
        film.sidecar.unlink()


if __name__ == "__main__":
    main(sys.argv[1:])
