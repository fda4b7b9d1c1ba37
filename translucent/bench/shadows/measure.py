"""Measurement of shadows on a ground: maps of several sizes and what others do, against the float64 reference."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Sequence
from typing import Literal

import numpy as np

from translucent.arrays import Array
from translucent.bench.codec import Packed
from translucent.bench.drawing import Studio
from translucent.bench.measure import one_line
from translucent.bench.record import CONSTANT, HALF, OPAQUE, ReportPicture, ShadowCase, ShadowRow
from translucent.bench.shadows.ground import USUAL, Ground, errors_of
from translucent.bench.shadows.maps import halve, map_times, texel_errors
from translucent.bench.shadows.pictures import png_of, signed
from translucent.bench.shadows.scenes import ShadowScene
from translucent.bench.timing import ratio, timing
from translucent.errors import TranslucentWarning

_PROMISES = {
    OPAQUE: "none: all or nothing",
    CONSTANT: "none: the best share of each body's diagonal that there is",
    HALF: "none: 11 bits for sums of signed distances",
}


@dataclasses.dataclass(frozen=True)
class ShadowEffort:
    """Effort of measuring shadows: widths of maps, of the map whose texels are looked at and of pictures, and seconds
    for the times of a map.
    """

    sizes: tuple[int, ...]
    texels: int
    pixels: int
    seconds: float


FULL = ShadowEffort((512, 1024, 2048, 4096), 512, 256, 1.0)
QUICK = ShadowEffort((512, 1024), 128, 128, 0.1)


def measure_shadow(studio: Studio, told: ShadowScene, effort: ShadowEffort) -> ShadowCase:
    """Measure one scene. What fails is a row with its reason; the rest goes on."""
    blank = ShadowCase(told.name, told.title, told.why)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TranslucentWarning)
            return _measured(studio, told, effort, blank)
    except Exception as error:  # noqa: BLE001 - a scene that breaks something leaves the others alone
        return dataclasses.replace(blank, failure=one_line(error))


def _measured(studio: Studio, told: ShadowScene, effort: ShadowEffort, blank: ShadowCase) -> ShadowCase:
    scene = told.make()
    ground = Ground(studio.renderer, scene, effort.pixels)
    opaque = len(scene.opaque) > 1
    maps = [_row(f"map of {size}", "method", size) for size in effort.sizes]
    rows, pictures = [], [_picture(ground, "reference", ground.truth)] if told.pictured else []
    for row in (*maps, *(_row(name, "counter-example", USUAL) for name in _PROMISES)):
        if row.method == HALF and opaque:
            rows.append(dataclasses.replace(row, refusal="drawn without opaque objects"))
            continue
        try:
            found = _found(studio, ground, row)
            errors = errors_of((found - ground.truth)[ground.away])
            new = dataclasses.replace(row, errors=errors, edges=ground.edges(found))
            if row.kind == "method":
                times = map_times(studio, scene, row.size, effort.seconds)
                new = dataclasses.replace(new, wall=timing(times.wall), ratio=ratio(times.part, times.floor))
            rows.append(new)
            if told.pictured and row.size == USUAL:
                pictures.append(_picture(ground, row.method, found))
        except Exception as error:  # noqa: BLE001 - whatever it is belongs in the row
            rows.append(dataclasses.replace(row, failure=one_line(error)))
    return dataclasses.replace(
        blank,
        triangles=sum(len(item.mesh.faces) for item in scene.objects[:-1]),
        bodies=len(scene.bodies),
        opaque=opaque,
        alike=len({tuple(item.medium.extinction.tolist()) for item in scene.bodies if item.medium is not None}) == 1,
        compared_points=int(ground.away.sum()),
        reference_seconds=ground.seconds,
        # Texels do not tell what is before the first opaque surface.
        texels=None if opaque else errors_of(texel_errors(studio.renderer, scene, effort.texels)),
        texel_size=effort.texels,
        order=_order(rows),
        rows=tuple(rows),
        pictures=tuple(pictures),
    )


def _row(method: str, kind: Literal["method", "counter-example"], size: int) -> ShadowRow:
    return ShadowRow(method, kind, size, _PROMISES.get(method, "exact in each texel's ray"))


def _found(studio: Studio, ground: Ground, row: ShadowRow) -> Array:
    """(h, w, 3): transmittance on the ground by one way."""
    if row.method == OPAQUE:
        return ground.unblocked(range(len(ground.scene.objects) - 1))
    if row.method == CONSTANT:
        return ground.constant()
    found = ground.shown(row.size)
    if row.method == HALF:
        halve(studio, ground.scene, row.size)
        found = ground.shown(row.size)
        studio.renderer.gpu.shadows.held = None
    return found


def _picture(ground: Ground, method: str, found: Array) -> ReportPicture:
    """The scene with this light on its ground, and the error of transmittance there."""
    shown = np.where(ground.seen[..., None], found * ground.bare, ground.frame.radiance) / ground.bright
    picture = png_of(dataclasses.replace(ground.frame, radiance=shown.astype(np.float32)).to_srgb8())
    if method == "reference":
        return ReportPicture(method, picture)
    return ReportPicture(method, picture, Packed.of(signed(found - ground.truth, ground.seen)))


def _order(rows: Sequence[ShadowRow]) -> float | None:
    """With which mean errors fall with the size of maps."""
    found = [(row.size, row.edges) for row in rows if row.kind == "method" and row.edges]
    if len(found) < 2:
        return None
    sizes, edges = np.log2(np.array(found, dtype=np.float64)).T
    return float(-np.polyfit(sizes, edges, 1)[0])
