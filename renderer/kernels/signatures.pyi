# The signatures of kernels, whose parameters the headers `sources/*/kernels.h` describe.
#
# `tests/support/kernel_records.py` makes this file from the headers. Only mypy reads it.

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.records import (
    AtlasTexels,
    BrickSums,
    Classifier,
    Grid,
    IndexRays,
    LayerBricks,
    LayerOptics,
    MaskGrid,
    ModelView,
    PathLight,
    PathMedium,
    PlacedVoxels,
    RayFog,
    RaySetup,
    SearchRules,
    StreamedLevel,
    TexelRules,
    TransferTable,
    VisibleNodes,
    Voxels,
)

class MeasureVoxelBricksCall(Protocol):
    def __call__(
        self,
        *,
        cells: NDArray[np.int32],
        texels: NDArray[np.float32] | None,
    ) -> None: ...

class MeasureVoxelBricks(Protocol):
    def partial(
        self,
        *,
        voxels: Voxels,
        breakpoints: NDArray[np.float64],
        curve: TransferTable,
        shown: NDArray[np.uint8] | None,
        are_lit: bool,
        bounds: NDArray[np.float32],
        measures: NDArray[np.float64],
        ranges: NDArray[np.float64],
    ) -> MeasureVoxelBricksCall: ...

class UpsampleRowsCall(Protocol):
    def __call__(
        self,
        *,
        first_row: int,
        end_row: int,
    ) -> None: ...

class UpsampleRows(Protocol):
    def partial(
        self,
        *,
        grid: NDArray[np.float32],
        image: NDArray[np.float32],
        factor: int,
    ) -> UpsampleRowsCall: ...

class RefineRowsCall(Protocol):
    def __call__(
        self,
        *,
        first_row: int,
        end_row: int,
    ) -> None: ...

class RefineRows(Protocol):
    def partial(
        self,
        *,
        grid: NDArray[np.float32],
        image: NDArray[np.float32],
        factor: int,
        threshold: float,
        is_linear: bool,
        places: NDArray[np.int32],
    ) -> RefineRowsCall: ...

class MarkContrastsCall(Protocol):
    def __call__(
        self,
        *,
        first_row: int,
        end_row: int,
    ) -> None: ...

class MarkContrasts(Protocol):
    def partial(
        self,
        *,
        image: NDArray[np.float32],
        threshold: float,
        is_linear: bool,
        marks: NDArray[np.uint8],
    ) -> MarkContrastsCall: ...

class DrawTilesCall(Protocol):
    def __call__(
        self,
        *,
        tiles: NDArray[np.int64],
    ) -> None: ...

class DrawTiles(Protocol):
    def partial(
        self,
        *,
        grid: Grid,
        bricks: LayerBricks,
        termination_alpha: float,
        is_additive: bool,
    ) -> DrawTilesCall: ...

class DrawMixtureCall(Protocol):
    def __call__(
        self,
        *,
        tiles: NDArray[np.int64],
    ) -> None: ...

class DrawMixture(Protocol):
    def partial(
        self,
        *,
        grid: Grid,
        groups: Sequence[LayerBricks],
        members: NDArray[np.int64],
        depths: NDArray[np.float64],
        termination_alpha: float,
    ) -> DrawMixtureCall: ...

class DrawExtremesCall(Protocol):
    def __call__(
        self,
        *,
        tiles: NDArray[np.int64],
    ) -> None: ...

class DrawExtremes(Protocol):
    def partial(
        self,
        *,
        grid: Grid,
        rays: RaySetup,
        boxes: NDArray[np.float64],
        tops: NDArray[np.float64],
        voxels: AtlasTexels,
        rules: SearchRules,
    ) -> DrawExtremesCall: ...

class AverageVoxelsCall(Protocol):
    def __call__(
        self,
        *,
        slab: int,
        out: NDArray[np.float32],
    ) -> None: ...

class AverageVoxels(Protocol):
    def partial(
        self,
        *,
        raw: NDArray[Any],
        by_pattern: NDArray[np.float32] | None,
        curve: TransferTable | None,
        ranges: NDArray[np.float64] | None,
        breakpoints: NDArray[np.float64],
        level: int,
    ) -> AverageVoxelsCall: ...

class TransmitCall(Protocol):
    def __call__(
        self,
        *,
        slab: int,
        out: NDArray[np.float32],
    ) -> None: ...

class Transmit(Protocol):
    def partial(
        self,
        *,
        depths: NDArray[np.float32],
        offsets: NDArray[np.float32],
        filled: NDArray[np.bool],
        lengths: NDArray[np.float32],
        end: NDArray[np.float64],
    ) -> TransmitCall: ...

class AverageMatterCall(Protocol):
    def __call__(
        self,
        *,
        slab: int,
    ) -> None: ...

class AverageMatter(Protocol):
    def partial(
        self,
        *,
        raw: NDArray[Any],
        scalars: NDArray[np.float64] | None,
        shown: NDArray[np.uint8] | None,
        is_labels: bool,
        curve: TransferTable,
        breakpoints: NDArray[np.float64],
        index_from_cells: NDArray[np.float64],
        num_places: int,
        out: NDArray[np.float32],
    ) -> AverageMatterCall: ...

class PrepareCellsCall(Protocol):
    def __call__(
        self,
        *,
        block: int,
        albedos: NDArray[np.float32],
        along_x: NDArray[np.float32],
        along_z: NDArray[np.float32],
    ) -> None: ...

class PrepareCells(Protocol):
    def partial(
        self,
        *,
        cells: NDArray[np.float32],
        path: float,
    ) -> PrepareCellsCall: ...

class ScatterLightCall(Protocol):
    def __call__(
        self,
        *,
        block: int,
        along_x: NDArray[np.float32],
        along_z: NDArray[np.float32],
    ) -> None: ...

class ScatterLight(Protocol):
    def partial(
        self,
        *,
        albedos: NDArray[np.float32],
        radiance: NDArray[np.float32],
        key: NDArray[np.float32],
        key_radiance: NDArray[np.float64],
    ) -> ScatterLightCall: ...

class GatherLightCall(Protocol):
    def __call__(
        self,
        *,
        block: int,
        out: NDArray[np.float32],
    ) -> None: ...

class GatherLight(Protocol):
    def partial(
        self,
        *,
        along_x: NDArray[np.float32],
        along_z: NDArray[np.float32],
    ) -> GatherLightCall: ...

class MeasureRoundCall(Protocol):
    def __call__(
        self,
        *,
        slab: int,
        products: NDArray[np.float64],
        largest: NDArray[np.float32],
    ) -> None: ...

class MeasureRound(Protocol):
    def partial(
        self,
        *,
        begun: NDArray[np.float32],
        ended: NDArray[np.float32],
        number: int,
    ) -> MeasureRoundCall: ...

class MixRoundsCall(Protocol):
    def __call__(
        self,
        *,
        slab: int,
        out: NDArray[np.float32],
    ) -> None: ...

class MixRounds(Protocol):
    def partial(
        self,
        *,
        ended: NDArray[np.float32],
        weights: NDArray[np.float32],
    ) -> MixRoundsCall: ...

class MeasureChordsCall(Protocol):
    def __call__(
        self,
        *,
        positions_px: NDArray[np.float64],
        lengths: NDArray[np.float32],
    ) -> None: ...

class MeasureChords(Protocol):
    def partial(
        self,
        *,
        rays: RaySetup,
        shape: tuple[int, int, int],
        absent: NDArray[np.bool] | None,
        unit: float,
    ) -> MeasureChordsCall: ...

class ColorSharesCall(Protocol):
    def __call__(
        self,
        *,
        shares: NDArray[np.float32],
        chords: NDArray[np.float32],
        brightness: NDArray[np.float32],
        image: NDArray[np.float32],
    ) -> None: ...

class ColorShares(Protocol):
    def partial(
        self,
        *,
        curve: TransferTable,
    ) -> ColorSharesCall: ...

class BuildBlocksCall(Protocol):
    def __call__(
        self,
        *,
        starts: NDArray[np.int64],
        extents: NDArray[np.int64],
        visible: NDArray[np.bool],
    ) -> None: ...

class BuildBlocks(Protocol):
    def partial(
        self,
        *,
        raw: NDArray[Any],
        classifier: Classifier,
        error_classifier: Classifier | None,
        ranges: NDArray[np.float64] | None,
        normalization: NDArray[np.float64] | None,
        leaf_variance_limits: NDArray[np.float64],
        occupied: NDArray[np.bool],
        occupied_level: int,
        streamed: Sequence[StreamedLevel],
        nodes: VisibleNodes,
    ) -> BuildBlocksCall: ...

class IntegrateRaysCall(Protocol):
    def __call__(
        self,
        *,
        rays: Sequence[IndexRays],
        max_steps: NDArray[np.float64],
        fog: RayFog | None,
        radiance: NDArray[np.float64],
    ) -> None: ...

class IntegrateRays(Protocol):
    def partial(
        self,
        *,
        layers: Sequence[LayerOptics],
        adds: bool,
    ) -> IntegrateRaysCall: ...

class SearchRaysCall(Protocol):
    def __call__(
        self,
        *,
        rays: IndexRays,
        found: NDArray[np.float64],
    ) -> None: ...

class SearchRays(Protocol):
    def partial(
        self,
        *,
        voxels: PlacedVoxels,
        tops: NDArray[np.float64],
        sign: float,
        least_rise: float,
    ) -> SearchRaysCall: ...

class TracePathsCall(Protocol):
    def __call__(
        self,
        *,
        rays: Sequence[IndexRays],
        fog: RayFog | None,
        states: NDArray[np.uint64],
        num_paths: int,
        radiance: NDArray[np.float64],
    ) -> None: ...

class TracePaths(Protocol):
    def partial(
        self,
        *,
        layers: Sequence[LayerOptics],
        media: Sequence[PathMedium],
        light: PathLight,
    ) -> TracePathsCall: ...

class Kernels:
    def guard_regions(
        self,
        *,
        regions: NDArray[np.int64],
        page_size: int,
    ) -> None: ...
    def heed_flag(
        self,
        *,
        flag: NDArray[np.int32],
    ) -> None: ...
    measure_voxel_bricks: MeasureVoxelBricks
    def add_nodes(
        self,
        *,
        cells: NDArray[np.int32],
        sizes: NDArray[np.int64],
        errors: NDArray[np.float64],
        is_visible: NDArray[np.bool],
        sums: BrickSums,
    ) -> None: ...
    def fill_scalar_texels(
        self,
        *,
        rules: TexelRules,
        cells: NDArray[np.int32],
        slots: NDArray[np.int64],
        texels: NDArray[np.float32],
    ) -> None: ...
    def extrapolate_border(
        self,
        *,
        cells: NDArray[np.int32],
        extents: NDArray[np.float64],
        brightest: float,
        texels: NDArray[np.float32],
    ) -> None: ...
    def place_bricks(
        self,
        *,
        rectangles_px: NDArray[np.float64],
        first_px: NDArray[np.float64],
        step_px: float,
        reach_px: float,
        shape: tuple[int, int],
        side: int,
        rectangles: NDArray[np.int64],
        tile_windows: NDArray[np.int64],
    ) -> None: ...
    def bin_bricks(
        self,
        *,
        tile_windows: NDArray[np.int64],
        have_rays: NDArray[np.bool],
        starts: NDArray[np.int64],
        numbers: NDArray[np.int64],
    ) -> None: ...
    upsample_rows: UpsampleRows
    refine_rows: RefineRows
    def place_edges(
        self,
        *,
        starts: NDArray[np.int64],
        num_corners: tuple[int, int, int],
        axis: int,
        level: int,
        shape: tuple[int, int, int],
        model_from_index: NDArray[np.float64],
        vertices: NDArray[np.float32],
    ) -> None: ...
    def draw_lines(
        self,
        *,
        vertices: NDArray[np.float32],
        voxel_side: float,
        colors: NDArray[np.float64],
        camera: ModelView,
        cover: float,
        opacity: float,
        min_side_px: float,
        image: NDArray[np.float32],
    ) -> None: ...
    mark_contrasts: MarkContrasts
    def spread_contrasts(
        self,
        *,
        image: NDArray[np.float32],
        threshold: float,
        is_linear: bool,
        pixels: NDArray[np.int64],
        marks: NDArray[np.uint8],
    ) -> None: ...
    def follow_lines(
        self,
        *,
        image: NDArray[np.float32],
        threshold: float,
        is_linear: bool,
        pixels: NDArray[np.int64],
        marks: NDArray[np.uint8],
    ) -> None: ...
    def average_rays(
        self,
        *,
        rays: NDArray[np.float32],
        num_rays: int,
        pixels: NDArray[np.int64],
        threshold: float,
        is_linear: bool,
        image: NDArray[np.float32],
        differ: NDArray[np.bool],
    ) -> None: ...
    draw_tiles: DrawTiles
    draw_mixture: DrawMixture
    draw_extremes: DrawExtremes
    def quantize(
        self,
        *,
        image: NDArray[np.float32],
        background: NDArray[np.float32],
        thresholds: NDArray[np.float32] | None,
        result: NDArray[np.uint8],
    ) -> None: ...
    average_voxels: AverageVoxels
    transmit: Transmit
    average_matter: AverageMatter
    prepare_cells: PrepareCells
    scatter_light: ScatterLight
    def sweep_light(
        self,
        *,
        shares: NDArray[np.float32],
        scattered: NDArray[np.float32],
        are_planes_first: bool,
        is_upwards: bool,
        offsets: NDArray[np.float32],
        entering: NDArray[np.float32],
        weights: NDArray[np.float64],
        out: NDArray[np.float32],
    ) -> None: ...
    def shine_key(
        self,
        *,
        shares: NDArray[np.float32],
        are_planes_first: bool,
        is_upwards: bool,
        offset: NDArray[np.float64],
        path: float,
        weight: float,
        out: NDArray[np.float32],
    ) -> None: ...
    gather_light: GatherLight
    measure_round: MeasureRound
    mix_rounds: MixRounds
    measure_chords: MeasureChords
    color_shares: ColorShares
    build_blocks: BuildBlocks
    def merge_tier(
        self,
        *,
        means: NDArray[np.float32],
        error_means: NDArray[np.float64],
        variances: NDArray[np.float64],
        places: NDArray[np.int64],
        extents: NDArray[np.int64],
        side: int,
        nodes: VisibleNodes,
    ) -> None: ...
    def average_cells(
        self,
        *,
        raw: NDArray[Any],
        classifier: Classifier,
        level: int,
        corners: NDArray[np.int64],
        means: NDArray[np.float32],
    ) -> None: ...
    def store_float16(
        self,
        *,
        values: NDArray[np.float32],
        factor: float,
        out: NDArray[np.uint16],
    ) -> None: ...
    def list_children(
        self,
        *,
        nodes: NDArray[np.int64],
        first_children: NDArray[np.int64],
        cells: NDArray[np.int32],
        masks: NDArray[np.uint8],
        child_nodes: NDArray[np.int64],
        child_cells: NDArray[np.int32],
    ) -> None: ...
    def find_voxels(
        self,
        *,
        raw: NDArray[Any],
        classifier: Classifier,
        parents: NDArray[np.int32],
        counts: NDArray[np.uint8],
        cells: NDArray[np.int32],
        depths: NDArray[np.float32],
    ) -> None: ...
    def place_splats(
        self,
        *,
        levels: NDArray[np.uint8],
        shapes: NDArray[np.uint8],
        cells: NDArray[np.int32],
        depths: NDArray[np.float32],
        shift_of_shape: NDArray[np.float64],
        area_of_shape: NDArray[np.float64],
        model_from_index: NDArray[np.float64],
        vertices: NDArray[np.float32],
    ) -> None: ...
    integrate_rays: IntegrateRays
    def mask_rays(
        self,
        *,
        layer: LayerOptics,
        rays: IndexRays,
        parts: NDArray[np.float64],
        counts: NDArray[np.int64],
    ) -> None: ...
    search_rays: SearchRays
    trace_paths: TracePaths
    def project_bounds(
        self,
        *,
        bounds: NDArray[np.float64],
        camera: ModelView,
        beyond: int,
        rectangles: NDArray[np.float64],
    ) -> None: ...
    def cull_splats(
        self,
        *,
        vertices: NDArray[np.float32],
        sigmas: NDArray[np.float64],
        cutoff: float,
        min_sigma_px: float,
        clipped_sigmas: float,
        culled_sigmas: float,
        camera: ModelView,
        along: NDArray[np.float64],
        depths: NDArray[np.float32],
        is_visible: NDArray[np.bool],
    ) -> None: ...
    def depth_order(
        self,
        *,
        depths: NDArray[np.float32],
        order: NDArray[np.uint32],
    ) -> None: ...
    def box_order(
        self,
        *,
        levels: NDArray[np.uint8],
        cells: NDArray[np.int32],
        eye: NDArray[np.float64],
        shape: tuple[int, int, int],
        order: NDArray[np.uint32],
    ) -> None: ...
    def mark_voxels(
        self,
        *,
        mask: MaskGrid,
        out: NDArray[np.uint8],
    ) -> None: ...
    def count_patterns(
        self,
        *,
        raw: NDArray[Any],
        counts: NDArray[np.int64],
    ) -> None: ...
