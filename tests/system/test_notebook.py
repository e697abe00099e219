"""The example notebook runs, and its cells show what the text promises."""

from __future__ import annotations

import base64
import re
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

from hsplat_cli import main
from renderer.film import Picture

NOTEBOOK = Path(__file__).resolve().parents[2] / "docs" / "api.ipynb"


@pytest.fixture(scope="module")
def outputs(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What the code cells show, one after the other, as MIME types."""
    folder = tmp_path_factory.mktemp("notebook")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(Path(main.__file__).parents[1]))
        patch.setenv("IPYTHONDIR", str(folder / "ipython"))
        notebook = nbformat.read(NOTEBOOK, as_version=4)
        client = NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": folder}})
        client.execute()
    shown = [cell.outputs for cell in notebook.cells if cell.get("outputs")]
    return [output[-1].get("data") or {"text/plain": "".join(part["text"] for part in output)} for output in shown]


def test_the_notebook_is_kept_without_outputs() -> None:
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in notebook.cells)


@pytest.mark.slow
def test_what_the_notebook_shows(outputs: list[dict[str, Any]]) -> None:
    array, image, shape, chosen, channels, labels, film, paths, truth, errors = outputs
    assert array["text/plain"] == "((48, 48, 48), dtype('float32'))"
    for output in (image, chosen, channels, labels):
        pixels = Picture(content=base64.b64decode(output["image/png"])).pixels
        assert pixels.shape == (256, 256, 3)
        assert np.ptp(pixels, axis=(0, 1)).max() > 100
    assert shape["text/plain"].startswith("((256, 256, 3), dtype('uint8'), ")
    assert 'src="data:image/gif;base64,R0lGODlh' in film["text/html"]
    assert "film.gif: 12 frames; how it was made: film.gif.json" in film["text/html"]
    assert "of 255 levels" in film["text/html"]
    assert "film.gif.json" in paths["text/plain"] and paths["text/plain"].endswith("12)")
    psnr = [float(number) for number in re.findall(r": ([0-9.]+) dB", truth["text/plain"])]
    assert psnr == sorted(psnr) and len(psnr) == 3 and psnr[0] < 35 and psnr[-1] > 45
    assert [line.split(":")[0] for line in errors["text/plain"].splitlines() if not line.startswith(" ")] == [
        "tolerance",
        "size.0",
        "background",
    ]
