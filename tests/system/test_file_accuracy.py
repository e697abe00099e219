"""The stated accuracy of an encoded film holds the error of its decoded frames against exact pictures."""

from __future__ import annotations

from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest
from small_scene import small_tree

from renderer import render
from renderer.accuracy import TRUTH_TOLERANCE, EncodingErrors, FrameProber, compute_truth, psnr
from renderer.frame import FilmAnnotation, FilmStage, prepare_stage
from renderer.record import FilmAccuracy, WorstFrame, with_encoding_errors
from renderer.scene import FilmScene, parse_scene

NUM_FRAMES = 4
SIZE = [72, 48]


def decoded_error(stage: FilmStage, file: Path) -> float:
    """Return the mean squared error of all pixels of a film that its annotation does not cover."""
    errors, annotation = [], FilmAnnotation(stage)
    for number, image in enumerate(imageio.imread(file)):
        covered = annotation.covered(number, None)
        is_open = np.ones(image.shape[:2], np.bool_) if covered is None else ~covered
        truth = compute_truth(stage, number, TRUTH_TOLERANCE)
        errors.append(np.mean((image[is_open] / 255 - truth.picture[is_open]) ** 2))
    return float(np.mean(errors))


def small_film(folder: Path, **sections: object) -> FilmScene:
    tree = small_tree(frames=NUM_FRAMES, error={"tolerance": 3, "probes": 128}, **sections)
    return parse_scene(tree | {"output": {"file": str(folder / "film.mp4"), "size": SIZE, "quality": 3}}, base=folder)


@pytest.mark.slow  # 6 s, of which exact pictures take most
@pytest.mark.parametrize("sections", [{}, {"annotation": {"title": "A title", "size": 0.1, "layout": "over"}}])
def test_the_interval_holds_the_error_of_decoded_frames(sections: dict[str, object], tmp_path: Path) -> None:
    scene = small_film(tmp_path, **sections)
    film = render(scene)
    assert film.accuracy is not None and film.accuracy.file is not None
    with prepare_stage(scene, clock=lambda: 0.0, num_threads=1) as stage:
        error = psnr(decoded_error(stage, film.path))
    assert film.accuracy.file.interval is not None
    low, high = film.accuracy.file.interval
    assert low <= error <= high < low + 4


def test_errors_of_drawing_that_an_encoder_blurs_away_are_not_counted(tmp_path: Path) -> None:
    with prepare_stage(small_film(tmp_path), clock=lambda: 0.0, num_threads=1) as stage:
        truth = compute_truth(stage, 0, TRUTH_TOLERANCE).picture
        exact = np.rint(255 * truth).astype(np.uint8)
        noise = 20 * (np.indices(exact.shape[:2]).sum(axis=0) % 2).astype(np.uint8)
        drawn = np.minimum(exact, 235) + noise[..., None]
        products = FrameProber(stage.first, 64).error_products(0, drawn, exact, None)
    error, loss = (float(np.mean((drawn / 255 - other) ** 2)) for other in (truth, exact / 255))
    accuracy = FilmAccuracy(psnr(error), (psnr(error), psnr(error)), 64, WorstFrame(0, 30, (30, 30)), 0.1, "any", 0)
    file = with_encoding_errors(accuracy, EncodingErrors(loss, products), 1, None).file
    assert file is not None and file.interval is not None
    assert file.psnr > psnr(error) + 6 and file.interval[1] > psnr(error) + 20
    assert file.interval[0] > psnr(error + loss) + 3
