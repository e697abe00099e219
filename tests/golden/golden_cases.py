"""The table of golden frames: what each one changes in scene.yaml, and what it protects.

The test compares them with what the scene gives now, and `regenerate.py` draws them again, by the program's own
commands `hsplat compare` and `hsplat golden`, each on a file of the case's scene. Each case has a folder in `frames`,
in which golden.json records the origin of its frames.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hsplat_cli import main
from renderer.readers import procedural_values
from renderer.scene import ProceduralSource, TreeEditor, dump_yaml, parse_yaml_file

FOLDER = Path(__file__).parent
SCENE = FOLDER / "scene.yaml"
FRAMES = FOLDER / "frames"


def oblique_scan(folder: Path) -> Path:
    """Write an anisotropic MetaImage, tilted about x and with one axis flipped, as of a tilted gantry."""
    values = procedural_values(ProceduralSource("engine_block", (40, 40, 20), seed=3, spacing=(1.0, 1.0, 2.0)))
    header = """\
ObjectType = Image
NDims = 3
TransformMatrix = -1 0 0 0 0.8 0.6 0 -0.6 0.8
Offset = 15 -20 4
ElementSpacing = 0.8 0.8 1.6
DimSize = 40 40 20
ElementType = MET_UCHAR
ElementDataFile = LOCAL
"""
    path = folder / "scan.mha"
    path.write_bytes(header.encode() + values.tobytes())
    return path


def signed_floats(folder: Path) -> Path:
    """Write a smooth field of float32 with values of both signs, as of a simulation."""
    x, y, z = np.meshgrid(*(np.linspace(-1, 1, n, dtype=np.float32) for n in (24, 20, 28)), indexing="ij", sparse=True)
    path = folder / "field.npy"
    np.save(path, (x * (1 - 2 * y * y) - z * x * y).T)
    return path


def colored_ball(folder: Path) -> Path:
    """Write voxels of red, green, blue and alpha: a ball whose colours and alpha are smooth."""
    z, y, x = np.meshgrid(*3 * [np.linspace(-1, 1, 20)], indexing="ij")
    alpha = np.clip(1.5 - 1.6 * np.sqrt(x * x + y * y + z * z), 0, 0.5)
    path = folder / "colors.npy"
    np.save(path, np.floor(255 * np.stack([x / 2 + 0.5, y / 2 + 0.5, z / 2 + 0.5, alpha], axis=-1)).astype(np.uint8))
    return path


_ALONE = ("volume=null", "transfer_function=null")
_ENGINE = "procedural: {name: engine_block, shape: [48, 48, 24], seed: 3}"
_BLOCK = (
    f"{{{_ENGINE}, name: block, shading: {{}}, clip: [{{plane: {{point: [24, 24, 14], normal: [0.3, 0, 1]}}}}],"
    " transfer_function: {unit: 1, points: [{value: 85, color: '#6699e6', opacity: 0}, {value: 125, color: '#80a6e6',"
    " opacity: 0.1}, {value: 145, color: '#f2b04d', opacity: 0.5}]}}"
)
_RINGS = (
    "{procedural: {name: marschner_lobb, shape: [40, 32, 24]}, name: rings, weight: 0.3, color: '#40c060', range: [120,"
    " 200], transform: [[0.7, -0.5, 0, 20], [0.5, 0.7, 0.2, 0], [0, -0.2, 0.8, 4], [0, 0, 0, 1]]}"
)
_CHANNELS = (
    f"{{{_ENGINE}, color: red, range: [20, 200], weight: 0.2}}, "
    f"{{{_ENGINE}, color: blue, range: [130, 240], weight: 0.5}}"
)


@dataclass(frozen=True)
class Case:
    """name: of its folder; protects: what would break unnoticed without it; changes: values of `--set`.

    frames: as in `--frames`; volume: writes a file for `--volume` into a folder.
    golden_changes: in place of `changes` when the golden is drawn: such a comparison must fail.
    """

    name: str
    protects: str
    changes: tuple[str, ...] = ()
    frames: str = "0"
    volume: Callable[[Path], Path] | None = None
    golden_changes: tuple[str, ...] | None = None

    def __str__(self) -> str:
        return self.name

    @property
    def folder(self) -> Path:
        """The folder of its goldens."""
        return FRAMES / self.name

    def compare(self, scratch: Path, *options: str) -> int:
        """Run `hsplat compare` with the case's goldens; return its exit code. scratch: a folder for files."""
        return self._run("compare", self.changes, scratch, *options)

    def keep(self, scratch: Path, *options: str) -> int:
        """Run `hsplat golden`; return its exit code."""
        changes = self.changes if self.golden_changes is None else self.golden_changes
        return self._run("golden", changes, scratch, "--frames", self.frames, *options)

    def _run(self, command: str, changes: tuple[str, ...], scratch: Path, *options: str) -> int:
        editor = TreeEditor(parse_yaml_file(SCENE.read_bytes(), SCENE), SCENE)
        editor.apply(changes, None if self.volume is None else self.volume(scratch), None)
        scene = scratch / f"{self}.yaml"
        scene.write_text(dump_yaml(editor.tree.data), "utf-8")
        return main.run([command, str(scene), "--goldens", str(FRAMES), *options])


_GOURAUD = "splat={footprint: gouraud, angular: 6, radial: 2}"
_SLAB = "volume={procedural: {name: constant, shape: [24, 24, 24]}}"
_VOXEL = "volume={procedural: {name: single_voxel, shape: [9, 9, 9]}}"
_LOBB = "volume={procedural: {name: marschner_lobb, shape: [40, 40, 40]}}"
_GLASS = "transfer_function={unit: 1.0, points: [{value: 0, color: '#ff8040', opacity: 0.05}]}"
_GLOSS = "shading={ambient: 0.3, diffuse: 0.6, light: camera, specular: 0.4, shininess: 20}"
_BOUNDARIES = "shading={ambient: 0.6, diffuse: 0.4, two_sided: true, gradient_opacity: [[5, 0], [50, 1]]}"
_DIMMED = "shading={ambient: 0.6, diffuse: 0.5, occlusion: 0.9, shadow: 0.7, occlusion_radius: 12}"
_CLIP = (
    "clip=[{plane: {point: [0, 0, 15], normal: [0, 0, 1]}}, "
    "{box: [[-9, -9, -9], [24, 24, 99]], fixed: object}, "
    "{plane: {point: [0, 0, 20], normal: [0, 0, 1]}, fixed: camera}]"
)
_ATLAS = "volume={procedural: {name: atlas, shape: [40, 40, 30], seed: 5}}"
_SHOWN = [3, 6, 9, 15, 19, 25, 30, 35, 44, 48, 60, 64, 72, 76, 81, 86, 101, 104, 124, 131, 136, 138, 144, 155, 165, 168]
_HEAT = "transfer_function={colormap: inferno, range: [0, 80]}"
_FILM = "transfer_function={colormap: gray_r, range: [0.3, 1]}"
_COARSE = "error.tolerance=0.8"
_DEFAULT = "splat=null"  # the default footprint
_INSIDE = ("camera.distance=6", "camera.field_of_view=70")
_VOXELS = "error.tolerance=0"
_CLEAR = "output.background=transparent"
_STILL = "camera.path={type: turntable, frames: 1, elevation: 0}"

CASES = (
    Case("turntable", "the whole chain as most users run it, from three sides", frames="::4"),
    Case("coarse", "a cut of large cells of several sizes", (_COARSE,)),
    Case("voxels", "tolerance 0: one splat for each visible voxel", (_VOXELS,)),
    Case("rms", "the paper's error measure", ("error={measure: rms, tolerance: 0.03}",)),
    Case("rms_scalar", "the paper's error of the scalar", ("error={measure: rms, of: scalar, tolerance: 20}",)),
    Case("average_opacity", "the paper's average", ("pyramid.average=opacity", _COARSE)),
    Case("uncorrected", "opacities that ignore cell sizes", ("splat.opacity_correction=false", _COARSE)),
    Case("gouraud", "the paper's footprint", (_GOURAUD,)),
    Case("gouraud_coarse", "the paper's footprint with large cells", (_GOURAUD, _COARSE)),
    Case("box_order", "the paper's traversal", ("splat.order=boxes", _COARSE)),
    Case("wide_splats", "the width of the footprint", ("splat.sigma=0.7",)),
    Case("along_axis", "no seams or ripples along the grid",
        (_SLAB, _GLASS, _VOXELS, _STILL, "camera.projection=orthographic")),
    Case("slab_turned", "the outline of a homogeneous block", (_SLAB, _GLASS, _VOXELS)),
    Case("orthographic", "parallel projection", ("camera.projection=orthographic",)),
    Case("wide_angle", "ellipses far from the axis", ("camera.field_of_view=90",)),
    Case("about_x", "an axis other than z", ("camera.path.axis=x",), frames="3"),
    Case("from_above", "the pole of the turntable", ("camera.path.elevation=90",)),
    Case("eye_inside", "splats around and behind the eye", _INSIDE),
    Case("near_plane", "what the near plane clips", ("camera.distance=70", "camera.near=66")),
    Case("off_centre", "a target, and what leaves the image", ("camera.target=[10, 24, 12]", "camera.distance=60")),
    Case("framed_visible", "framing what can be seen: here only the lower part of the volume",
        (_LOBB, "camera.target=visible",
        "transfer_function={points: [{value: 190, color: white, opacity: 0}, {value: 220, color: white,"
        " opacity: 0.1}]}")),
    Case("wide_image", "images that are not square", ("output.size=[128, 61]",)),
    Case("transparent", "straight alpha", (_CLEAR,)),
    Case("overlay", "the octree's cells as lines, with their opacity", ("annotation.octree=true", _COARSE, _CLEAR)),
    Case("overlay_inside", "lines around the eye", ("annotation.octree=true", _COARSE, *_INSIDE)),
    Case("finest_level", "no cells smaller than asked for", ("error.finest_level=2",)),
    Case("shading", "Lambert's law, light fixed to the object", ("shading={light: [1, -1, 1]}",), frames="::6"),
    Case("colormap", "named colormaps and their opacity points",
        ("transfer_function={colormap: viridis, range: [40, 220], opacity: [[60, 0], [90, 0.1], [220, 0.8]]}",)),
    Case("keyframes", "eased keys with zoom",
        ("camera.path={type: keyframes, frames: 20, keys: [{frame: 0, azimuth: 0, elevation: 0},"
        " {frame: 10, azimuth: 100, elevation: 60, zoom: 1.8}]}",), frames="3:16:6"),
    Case("motion", "a plane, colours, light and a background that move, eased",
        (_DEFAULT, "shading={light: {0: [1, 0, 0], 8: [0, -1, 1]}, specular: 0.3}",
        "clip=[{plane: {point: {0: [48, 0, 0], 8: [8, 0, 0], easing: smooth}, normal: [1, 0, 0]}}]",
        "transfer_function.points.1.color={0: white, 8: red}", "output.background={0: black, 8: '#405060'}"), "::3"),
    Case("flight", "a path of two pieces, and an eye that rolls",
        (_DEFAULT, "camera.path=[{type: turntable, frames: 2}, {type: flight, frames: 9, keys: ["
        "{position: [24, -40, 40], target: [24, 24, 12]}, {position: [10, 10, 20], target: [40, 40, 12], roll: 30}]}]"),
        "2::4"),
    Case("beat", "a volume that changes in time",
        (_DEFAULT, "volume={procedural: {name: beating_heart, shape: [32, 32, 32], phase: {0: 0, 8: 0.5}}}"), "::4"),
    Case("rocker", "the extremes of a swing", ("camera.path={type: rocker, frames: 8, swing: 80}",), frames="2::4"),
    Case("schedule", "tolerances by frame", ("error.tolerance={0: 2, 4: 0.2}",), frames="0:8:4"),
    Case("single_voxel", "one footprint", (_VOXEL,)),
    Case("large_splat", "a splat larger than points can be, its centre outside",
        (_VOXEL, "camera.field_of_view=5", "camera.distance=10", "camera.target=[4.7, 4, 4.3]")),
    Case("marschner_lobb", "frequencies near the limit of the grid",
        (_LOBB, "transfer_function={points: [{value: 110, color: '#30a0ff', opacity: 0}, {value: 140, color: '#ffe0a0',"
        " opacity: 0.6}]}")),
    Case("cropped", "ranges of voxels, at their place",
        ("volume.crop=[[10, 40], [0, 30], [4, 24]]", "camera.target=[24, 24, 12]", "camera.distance=110")),
    Case("anisotropic", "ellipsoids",
        ("volume.procedural={name: engine_block, shape: [48, 48, 12], spacing: [1, 1, 2]}",)),
    Case("oblique", "direction matrix, spacing and origin of a file", volume=oblique_scan),
    Case("signed_floats", "classification of floats, and negative values",
        ("transfer_function={unit: 0.5, points: [{value: -1, color: '#2060ff', opacity: 0.4}, {value: -0.2, color:"
        " '#2060ff', opacity: 0}, {value: 0.2, color: '#ff6020', opacity: 0}, {value: 1, color: '#ff6020',"
        " opacity: 0.4}]}",), volume=signed_floats),
    Case("default", "the default footprint, every pixel drawn", (_DEFAULT,), "::4"),
    Case("default_coarse", "bricks of large cells, and pixels between others", (_DEFAULT, "error.tolerance=1.0")),
    Case("default_voxels", "the finest steps", (_DEFAULT, _VOXELS, "camera.path.start=50")),
    Case("default_shading", "gradients in bricks", (_DEFAULT, "shading={light: [1, -1, 1]}")),
    Case("default_inside", "bricks around and behind the eye", (_DEFAULT, *_INSIDE)),
    Case("default_orthographic", "parallel rays", (_DEFAULT, "camera.projection=orthographic")),
    Case("default_near_plane", "bricks that the near plane clips", (_DEFAULT, "camera.distance=70", "camera.near=66")),
    Case("default_overlay", "the edges of bricks over them", (_DEFAULT, "annotation.octree=true", _CLEAR)),
    Case("bounds", "the outline of the volume, with ticks", (_DEFAULT, "annotation.bounds=true", _CLEAR)),
    Case("annotation", "what is written over a picture, on a gradient", (_DEFAULT, *_ALONE,
        f"volumes=[{_BLOCK}, {_RINGS}]", "output.size=[320, 240]", "output.background={top: '#203040', bottom: white}",
        "annotation={layout: over, title: Block and rings, time: 'frame {frame}', legend: true, color_bar: true,"
        " scale_bar: true, orientation: true, bounds: true}"), "3:4"),
    Case("default_oblique", "bricks of voxels that are no cubes", (_DEFAULT,), volume=oblique_scan),
    Case("must_fail", "the comparison: its golden is of another scene, drawn half a degree further round",
        golden_changes=("camera.path.start=20.5",)),
    Case("light_of_the_camera", "light and highlights that follow the viewer", (_DEFAULT, _GLOSS), frames="::6"),
    Case("gradient_opacity", "boundaries alone", (_DEFAULT, _BOUNDARIES)),
    Case("occlusion", "ambient light that is dimmed, and shadows", (_DEFAULT, _DIMMED)),
    Case("cut_open", "what a plane and a box clip away", (_DEFAULT, _CLIP)),
    Case("maximum", "the largest scalar of a ray", (_DEFAULT, "mode=maximum")),
    Case("maximum_by_depth", "where the largest scalar is", (_DEFAULT, "mode={type: maximum, color_by: depth}")),
    Case("minimum", "the smallest scalar of a ray, from inside", (_DEFAULT, *_INSIDE, "mode=minimum")),
    Case("mean", "the mean scalar over the box", (_DEFAULT, "mode=mean", _HEAT)),
    Case("volumes", "two volumes in grids of their own, mixed", (_DEFAULT, *_ALONE, f"volumes=[{_BLOCK}, {_RINGS}]")),
    Case("volumes_added", "light that adds up, on one grid and on another",
        (_DEFAULT, *_ALONE, f"volumes=[{_CHANNELS}, {_RINGS}]", "blend=add")),
    Case("labels", "labels between voxels, their colours, and cells larger than voxels",
        (_DEFAULT, _ATLAS, "transfer_function=null", "labels={colors: {7: red, third: '#30c060'}, names: {3: third},"
        " opacity: {9: 0.2}, hide: [1, 2]}"), "::6"),
    Case("labels_lit", "normals of labels, and the faces of those that are cut open", (_DEFAULT, _ATLAS,
        "transfer_function=null", f"labels={{opacity: 0.9, unit: 2, colors: auto, show: {_SHOWN}}}",
        "shading={light: [1, -1, 1]}", _CLIP)),
    Case("mask", "a part of a volume, by labels on a grid of their own", (_DEFAULT, "shading={}",
        "mask={procedural: {name: atlas, shape: [13, 17, 9], spacing: [3.5, 2.7, 2.6]}, hide: [3, eight],"
        " names: {8: eight}, transform: [[0.9, 0.3, 0, -4], [-0.3, 0.9, 0, 6], [0, 0, 1, 0], [0, 0, 0, 1]]}")),
    Case("colors", "voxels that are colours, as opaque as their alpha", (_DEFAULT, "transfer_function=null",
        "volume.component=color"), volume=colored_ball),
    Case("attenuation", "an X-ray picture", (_DEFAULT, "mode={type: attenuation, scale: 0.0005, zero: 20}", _FILM)),
)  # fmt: skip
