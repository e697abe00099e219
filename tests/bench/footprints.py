"""Which footprint is the better trade? `python tests/bench/footprints.py DATA` writes docs/benchmarks/footprints.md.

Draws a frame of many volumes with each footprint at many tolerances, and asks for each accuracy which one reaches it in
less time. Times are those of the processors, of all threads, so that other work on the machine matters little.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import imageio.v3 as iio
import numpy as np
from measuring import PAGES, ROOT, SCENES, THREADS, Point, fastest, machine_line, parser_of, render_command, timed

from hsplat_cli.scenes import suggest_scene
from hsplat_cli.terminal import Reporter
from renderer.accuracy import TRUTH_TOLERANCE, Truth, compute_truth
from renderer.draw import open_rasterizer
from renderer.frame import Stage, prepare_stage, render_frames
from renderer.scene import (
    FileSource,
    RawSource,
    Scene,
    ShadingSpec,
    SplatSpec,
    VolumeSpec,
    load_scene,
    parse_scene_content,
    with_tolerance,
)
from renderer.study import measure_setting
from renderer.suggest import FilmOptions

PAGE, PICTURE = PAGES / "footprints.md", ROOT / "docs" / "trade.png"

ACCURACIES = (20.0, 25.0, 30.0, 35.0, 40.0, 45.0)
FOOTPRINTS = {
    "integrated": SplatSpec(footprint="integrated"),
    "gaussian": SplatSpec(footprint="gaussian"),
}
# Below 0.1 splats are voxels nearly everywhere, and get no more exact.
FINE = {"integrated": (0.07, 0.05, 0.03, 0.02, 0.01, 0.003, 0.001, 0.0), "gaussian": (0.05, 0.02, 0.01, 0.003, 0.0)}
TOLERANCES = (30.0, 10.0, 5.0, 3.0, 2.0, 1.4, 1.0, 0.7, 0.5, 0.4, 0.3, 0.2, 0.15, 0.1)
FRAME = 11  # of 120: along no axis
SHOWN, SHOWN_FRAME = (20.0, 1.0, 0.3, 0.03), 4  # in the picture
REPEATS = 5
# Finer tolerances than one that takes so long are left out.
LONG_S = 4.0


class Subject(NamedTuple):
    """A scene, and what it shows."""

    what: str
    scene: Scene


def main() -> None:
    data = parser_of(__doc__).parse_args().data
    found = {}
    for name, subject in subjects(data).items():
        found[name] = figures(subject)
        print("\n".join(table(name, found[name])), flush=True)
    lines = [*head(found), *row_of_pictures(), *stills(data, found)]
    lines += [line for name, each in found.items() for line in table(name, each)]
    PAGE.write_text("\n".join(lines).rstrip() + "\n")


HEAD = """# The footprints compared

Footprints: `integrated`, the default, and splats (`footprint: gaussian`). Measure again when the cut, the drawing of
either footprint or the default changes.

`python tests/bench/footprints.py DATA` writes this page. It draws one frame of 256 x 256, along no axis, and gives the
processor time of all threads, the median of up to five warm frames, at the fastest tolerance that reaches each accuracy
against the converged ray integral. Tolerances from 30 down to 0 were tried for both footprints. `integrated` is the
default because of these numbers.

{machine}

| accuracy | integrated / gaussian, least | median | most | volumes where only integrated reaches it |
| --- | --- | --- | --- | --- |"""


def head(found: dict[str, Any]) -> Iterator[str]:
    """What the page says first: the range of the ratios at each accuracy."""
    yield HEAD.format(machine=machine_line())
    for accuracy in ACCURACIES:
        ratios = [ratio for each in found.values() if (ratio := ratio_at(each, accuracy)) is not None]
        alone = sum(
            fastest(each["points"]["integrated"], accuracy) is not None and ratio_at(each, accuracy) is None
            for each in found.values()
        )
        yield (
            f"| {accuracy:g} dB | {min(ratios):.2f} | {statistics.median(ratios):.2f} | {max(ratios):.2f} "
            f"| {alone} of {len(found)} |"
        )
    yield ""


def row_of_pictures() -> Iterator[str]:
    """Write docs/trade.png, a frame of the demo at some tolerances, coarse ones first; what the page says of it."""
    scene = load_scene(ROOT / "configs" / "demo.yaml")
    scene = replace(scene, output=replace(scene.output, size=(320, 320)))
    stage = prepare_stage(scene, clock=time.process_time, num_threads=THREADS, any_tolerance=True)
    truth = compute_truth(stage, SHOWN_FRAME, TRUTH_TOLERANCE)
    pictures = []
    with open_rasterizer(stage.scene) as rasterizer:
        for tolerance in SHOWN:
            at = replace(stage, scene=with_tolerance(stage.scene, tolerance))
            pictures += [frame.image for frame in render_frames(at, [SHOWN_FRAME], rasterizer, clock=time.process_time)]
    iio.imwrite(PICTURE, np.concatenate(pictures, axis=1))
    points = list(measured(stage, truth, SHOWN))
    yield f"![The demo at {', '.join(f'{p.psnr:.0f}' for p in points)} dB](../{PICTURE.name})"
    yield ""
    yield (
        f"The demo at `tolerance` {', '.join(f'{p.setting}' for p in points)}: "
        f"{', '.join(f'{p.psnr:.0f}' for p in points)} dB in {', '.join(f'{p.ms:.0f}' for p in points)} ms."
    )
    yield ""


def stills(data: Path, found: dict[str, Any]) -> Iterator[str]:
    """A single picture by a whole command, where the footprint that needs more beforehand loses most."""
    text = (
        "`hsplat render --frames 11`: processor seconds with start-up, reading and encoding, medians of three. "
        "Bricks need the whole pyramid; splats at a coarse tolerance need a part of it. The first frames of a film "
        "win back what that costs."
    )
    yield from ("## One picture, from the command to the file", "", text, "")
    yield "| scene | accuracy | integrated | gaussian | ratio |"
    yield "| --- | --- | --- | --- | --- |"
    for name, scene, volume in (
        ("demo", ROOT / "configs" / "demo.yaml", None),
        ("engine_close", SCENES / "engine_close.yaml", data / "engine.nhdr"),
        ("bonsai_close", SCENES / "bonsai_close.yaml", data / "bonsai.nhdr"),
    ):
        for accuracy in (20.0, 30.0):
            cpu = {}
            for footprint in FOOTPRINTS:
                best = fastest(found[name]["points"][footprint], accuracy)
                assert best is not None, (name, footprint, accuracy)
                cpu[footprint] = statistics.median(command_s(scene, volume, footprint, best) for _ in range(3))
            own, other = cpu["integrated"], cpu["gaussian"]
            yield f"| {name} | {accuracy:g} dB | {own:.2f} s | {other:.2f} s | {own / other:.2f} |"
    yield ""


def command_s(scene: Path, volume: Path | None, footprint: str, point: Point) -> float:
    """Processor seconds of a whole command that draws one frame."""
    changes = ("output.size=[256, 256]", f"splat={{footprint: {footprint}}}", f"error.tolerance={point.setting}")
    with tempfile.TemporaryDirectory() as folder:
        command = render_command(scene, volume, Path(folder, "still.png"), changes)
        return timed([*command, "--workers", "1", "--frames", str(FRAME)])[1]


def ratio_at(found: dict[str, Any], accuracy: float) -> float | None:
    """Time of the integrated footprint over the other's, where both reach the accuracy."""
    own, other = (fastest(found["points"][footprint], accuracy) for footprint in ("integrated", "gaussian"))
    return own.ms / other.ms if own and other else None


def subjects(data: Path) -> dict[str, Subject]:
    """The volumes, most with the scene that `hsplat init` suggests."""
    engine, bonsai = data / "engine.nhdr", data / "bonsai.nhdr"
    walnut = RawSource(data / "walnut.raw", (128, 96, 114), "uint16", spacing=(0.015625,) * 3)
    close_engine = load_scene(SCENES / "engine_close.yaml", volume=engine)
    own = {
        "engine_close": Subject("CT of an engine, filling the picture", close_engine),
        "bonsai_close": Subject(
            "CT of a bonsai, filling the picture", load_scene(SCENES / "bonsai_close.yaml", volume=bonsai)
        ),
        "engine_lit": Subject("the same engine, lit", replace(close_engine, shading=ShadingSpec())),
        "demo": Subject("configs/demo.yaml", load_scene(ROOT / "configs/demo.yaml")),
        "marschner_lobb": Subject("configs/marschner_lobb.yaml", load_scene(ROOT / "configs/marschner_lobb.yaml")),
    }
    read: dict[str, tuple[str, FileSource | RawSource]] = {
        "hydrogen": ("simulation, 128^3", FileSource(data / "hydrogenAtom.nhdr")),
        "fuel": ("simulation, 64^3", FileSource(data / "fuel.nhdr")),
        "ct_pitch": ("CT of a head, oblique", FileSource(data / "medical/CT_pitch.nii.gz")),
        "t1": ("MRI, anisotropic", FileSource(data / "medical/t1_dicom_part")),
        "walnut": ("micro-CT", walnut),
        "lidc": ("CT of a chest", FileSource(data / "medical/LIDC2.mha")),
        "engine": ("CT, as `hsplat init` suggests", FileSource(engine)),
        "bonsai": ("CT, as `hsplat init` suggests", FileSource(bonsai)),
    }
    return own | {name: Subject(what, suggested(VolumeSpec(source))) for name, (what, source) in read.items()}


def suggested(volume: VolumeSpec) -> Scene:
    """As `hsplat init` has it."""
    scene = Path("suggested.yaml")
    text, _ = suggest_scene(volume, FilmOptions(), Reporter(), scene=scene, output=Path("film.mp4"))
    return parse_scene_content(text.encode(), scene, overrides=(), volume=None, output=None, is_single_frame=False)


def figures(subject: Subject, size: int = 256) -> dict[str, Any]:
    """All settings of a subject, by footprint, and processor seconds of what a film does once."""
    scene = replace(subject.scene, output=replace(subject.scene.output, size=(size, size)))
    truth: Truth | None = None
    points: dict[str, list[Point]] = {}
    once: dict[str, float] = {}
    for footprint, splat in FOOTPRINTS.items():
        own = replace(scene, splat=splat)
        for _ in range(2):  # the first compiles
            stage = prepare_stage(own, clock=time.process_time, num_threads=THREADS, any_tolerance=True)
        once[footprint] = stage.seconds["pyramid"] + stage.seconds.get("bricks", 0.0)
        if truth is None:
            truth = compute_truth(stage, FRAME, TRUTH_TOLERANCE)
        points[footprint] = list(measured(stage, truth, (*TOLERANCES, *FINE[footprint])))
    return {"what": subject.what, "once_s": once, "points": points}


def measured(stage: Stage, truth: Truth, tolerances: Sequence[float]) -> Iterator[Point]:
    """Each tolerance, from coarse to fine, until frames take too long."""
    with open_rasterizer(stage.scene) as rasterizer:
        for tolerance in tolerances:
            at = replace(stage, scene=with_tolerance(stage.scene, tolerance))
            found = measure_setting(at, [truth], rasterizer, clock=time.process_time, repeats=REPEATS)
            yield Point(f"{tolerance:g}", found.overall.everywhere["psnr"], 1e3 * found.frame_seconds)
            if found.frame_seconds > LONG_S:
                return


def table(name: str, found: dict[str, Any]) -> Iterator[str]:
    """Rows: accuracy, and each footprint's fastest setting that reaches it."""
    yield f"## {name}: {found['what']}"
    yield ""
    yield "| accuracy | " + " | ".join(FOOTPRINTS) + " | integrated / gaussian |"
    yield "| --- " * (len(FOOTPRINTS) + 2) + "|"
    for accuracy in ACCURACIES:
        best = {footprint: fastest(found["points"][footprint], accuracy) for footprint in FOOTPRINTS}
        cells = [f"{p.ms:.1f} ms at {p.setting}" if p else "not reached" for p in best.values()]
        at = ratio_at(found, accuracy)
        ratio = f"{at:.2f}" if at else ("only integrated" if best["integrated"] else "")
        yield f"| {accuracy:g} dB | " + " | ".join(cells) + f" | {ratio} |"
    yield ""
    once = ", ".join(f"{footprint} {seconds:.2f} s" for footprint, seconds in found["once_s"].items())
    yield f"Pyramid and bricks: {once}."
    yield ""


if __name__ == "__main__":
    main()
