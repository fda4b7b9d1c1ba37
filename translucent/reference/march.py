"""Ray marching with a fixed number of steps, by all common quadratures and orders of compositing."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask
from translucent.errors import InputError
from translucent.formulas import optics
from translucent.frames.frame import Frame
from translucent.planning.methods import Method, RayMarched
from translucent.planning.passes import Note, NoteKind, PassName, PassSpec
from translucent.planning.render_plan import RenderPlan
from translucent.reference import compositing as blending
from translucent.reference.compositing import ColorLayer, _layers
from translucent.reference.hits import Rays, pixel_rays
from translucent.reference.light_paths import LightPaths, SurfaceLight
from translucent.reference.quadrature import MarchSteps, even_steps, gauss_steps, hashed
from translucent.reference.render import CrossedMedia, crossed_media, radiance_behind, scene_hits
from translucent.reference.scattering import light_source, light_variable
from translucent.reference.volume import points_on
from translucent.scene.camera import check_size
from translucent.scene.lights import PositionalLight
from translucent.scene.scene import Light, Scene

Compositing = Literal["front-to-back", "back-to-front"]

#: Number of samples that are evaluated together: the working arrays stay below 500 MB.
SAMPLES = 1 << 17


def march(
    scene: Scene,
    size: tuple[int, int],
    method: RayMarched | None = None,
    *,
    aligned: bool = True,
    compositing: Compositing = "front-to-back",
    associated: bool = True,
    termination: float = 0.0,
) -> Frame:
    """March through a scene: absorption, emission and light scattered once, by sums over steps (Max 1995, section 4).

    Thickness and all light paths are exact, those of `render`; only the sums over the view rays have an error.

    Parameters
    ----------
    scene : Scene
        Without sheets, which have no inside.
    size : (width, height)
        In pixels.
    method : RayMarched, optional
        The quadrature and its number of steps.
    aligned : bool
        The steps of each interval begin and end on its surfaces. False spreads the steps of each ray over the ball
        around the scene, whatever surfaces are there: an order of convergence is lost.
    compositing : {"front-to-back", "back-to-front"}
        The order in which steps are put over each other; the result is the same.
    associated : bool
        Colors of steps are multiplied by their opacity; the result is the same. Without opacity none is unassociated.
    termination : float
        A ray stops where the transmittance of all channels is below this, 0 to 1, front to back only. What it leaves
        out is at most `termination` times the radiance that comes from there.

    Returns
    -------
    Frame
        Of float64 arrays. Pixels are invalid as those of `render` are, but for its tolerance.

    Raises
    ------
    InputError
        If an argument is not in its range, the scene has sheets, or `associated` is False and something shines without
        being opaque at all.
    """
    began = time.perf_counter()
    scheme = _Scheme(method or RayMarched(), aligned, compositing, associated, termination)
    width, height = check_size(size)
    if any(body.sheet_thickness is not None for body in scene.bodies):
        raise InputError(
            "ray marching", "the scene has thin-walled sheets, which have no inside", "use tl.reference.render"
        )
    paths = LightPaths(scene, (None,) * len(scene.objects))
    rays = pixel_rays(scene.camera, (width, height))
    media = crossed_media(SurfaceLight(paths), rays, scene_hits(scene, (width, height)), paths.sheets)
    work = _March(scheme, paths, rays, media, width)
    arrays = work.arrays()
    return Frame(
        **{name: array.reshape(height, width, *array.shape[1:]) for name, array in arrays.items()},
        plan=RenderPlan(
            scene,
            scheme.method,
            (PassSpec(PassName.MARCH, f"asked for: {scheme}"),),
            limits=(
                Note(NoteKind.STEPS, f"optical depth is summed over {scheme.method.steps} steps in each interval"),
            ),
        ),
        seconds={"total": time.perf_counter() - began},
        provenance={"backend": "reference", "numpy": np.__version__},
        scene=scene,
    )


@dataclass(frozen=True)
class _Scheme:
    """Checked marching scheme."""

    method: RayMarched
    aligned: bool
    compositing: Compositing
    associated: bool
    termination: float

    def __post_init__(self) -> None:
        if not isinstance(self.method, Method) or not self.method.marches:
            raise InputError(f"marching by {self.method!r}", "this is not a ray marching method", "use tl.RayMarched")
        if self.compositing not in (known := get_args(Compositing)):
            raise InputError(
                f"compositing {self.compositing!r}", "no compositing has this name", f"use one of {', '.join(known)}"
            )
        if not 0 <= self.termination < 1:
            raise InputError(
                f"termination {self.termination}", "the value must lie in 0 to 1", "use a value such as 1e-3"
            )
        if self.termination > 0 and self.compositing != "front-to-back":
            raise InputError(
                f"termination {self.termination} from back to front",
                "only compositing from front to back knows which parts are hidden",
                "use front-to-back compositing",
            )

    def __str__(self) -> str:
        return f"{self.method}, {'' if self.aligned else 'not '}aligned to surfaces, {self.compositing}"


@dataclass(frozen=True, eq=False)
class _Spans:
    """Spans of rays to march through, one per ray, as flat arrays.

    `segments` is (k,), the segment that each span is, or None where a span may hold any segments, or none.
    """

    ray: Integers
    start: Array
    end: Array
    segments: Integers | None
    number: int

    def where(self, some: slice) -> _Spans:
        owner = None if self.segments is None else self.segments[some]
        return _Spans(self.ray[some], self.start[some], self.end[some], owner, self.number)


@dataclass(frozen=True, eq=False)
class _Terms:
    """Source terms of a march: emission, some lights, and the light for which steps are equiangular."""

    emission: bool
    lights: tuple[Light, ...]
    variable: Light | None = None


class _March:
    """March of all rays of a picture."""

    def __init__(self, scheme: _Scheme, paths: LightPaths, rays: Rays, media: CrossedMedia, width: int) -> None:
        self.scheme, self.paths, self.rays, self.media, self.width = scheme, paths, rays, media, width
        self.sound = ~media.defective

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Flat arrays of a frame by their names."""
        first, *others = (self._composited(terms) for terms in self._all_terms())
        behind = radiance_behind(SurfaceLight(self.paths), self.rays, self.media.wall)
        with np.errstate(under="ignore"):
            left = np.where(self._stopped(first)[:, None], 0.0, first.transmittance)
            radiance = first.color + sum((layer.color for layer in others), left * behind)
        segments = self.media.segments
        coverage = self.media.defective.copy()
        coverage[segments.pixel] = True
        thickness = np.bincount(segments.pixel, segments.count * segments.length, len(self.rays))
        return {
            "radiance": radiance,
            "transmittance": first.transmittance,
            "optical_depth": first.optical_depth,
            "thickness": thickness.astype(np.float64),
            "coverage": coverage,
            "valid": self.sound & np.isfinite(first.optical_depth).all(axis=1),
        }

    def _all_terms(self) -> list[_Terms]:
        """Terms of all marches: one per point light, because equiangular steps belong to one light."""
        lights = self.paths.lights if self.paths.volume.scatters else ()
        if self.scheme.method.quadrature != "equiangular":
            return [_Terms(True, lights)]
        point = tuple(light for light in lights if isinstance(light, PositionalLight))
        other = tuple(light for light in lights if not isinstance(light, PositionalLight))
        return [_Terms(True, other), *(_Terms(False, (light,), light) for light in point)]

    def _composited(self, terms: _Terms) -> ColorLayer:
        """Composite of all steps of each ray as one layer with associated color, (rays, 3)."""
        shape = (len(self.rays), 3)
        total = ColorLayer(np.zeros(shape), np.zeros(shape))
        front_to_back = self.scheme.compositing == "front-to-back"
        blend = blending.over if self.scheme.associated else blending.over_unassociated
        spans = list(self._spans())
        for span in spans if front_to_back else reversed(spans):
            for part in _slices(span, self.scheme.method.steps):
                layers = self._layers(part, terms)
                for layer in layers if front_to_back else reversed(layers):
                    on = ~self._stopped(ColorLayer(total.color[part.ray], total.optical_depth[part.ray]))
                    ray, step = part.ray[on], ColorLayer(layer.color[on], layer.optical_depth[on])
                    so_far = ColorLayer(total.color[ray], total.optical_depth[ray])
                    blended = blend(so_far, step) if front_to_back else blend(step, so_far)
                    total.color[ray], total.optical_depth[ray] = blended.color, blended.optical_depth
        return total if self.scheme.associated else blending.associated(total)

    def _stopped(self, layer: ColorLayer) -> Mask:
        """(k,): rays that end, since this layer is nearly opaque."""
        return np.asarray(layer.transmittance.max(axis=1) < self.scheme.termination)

    def _spans(self) -> Iterator[_Spans]:
        """Spans that each ray marches through, from the eye; at most one span of each ray at a time."""
        segments = self.media.segments
        if self.scheme.aligned:
            for number, owner in enumerate(_layers(segments.pixel)):
                yield _Spans(segments.pixel[owner], segments.t_enter[owner], segments.t_exit[owner], owner, number)
        else:
            start, end = self.paths.tracer.ball(self.rays.origins, self.rays.directions)
            ray = np.unique(segments.pixel)
            yield _Spans(ray, np.maximum(start[ray], 0.0), end[ray], None, 0)

    def _layers(self, spans: _Spans, terms: _Terms) -> list[ColorLayer]:
        """Color and optical depth of the steps of each span, in order."""
        steps = self._steps(spans, terms)
        extinction, source = self._sampled(spans, steps.at, terms)
        with np.errstate(under="ignore", over="ignore"):
            depth = extinction * (steps.end - steps.begin)[..., None]
            if self.scheme.method.quadrature == "exponential":
                color = optics.emitted_radiance(source, extinction, (steps.end - steps.begin)[..., None])
            else:
                before = optics.transmittance(extinction * (steps.at - steps.begin)[..., None])
                color = source * before * steps.weight[..., None]
        layers = [ColorLayer(color[:, i], depth[:, i]) for i in range(depth.shape[1])]
        return layers if self.scheme.associated else [blending.unassociated(layer) for layer in layers]

    def _steps(self, spans: _Spans, terms: _Terms) -> MarchSteps:
        """Positions of the samples."""
        method = self.scheme.method
        if method.quadrature == "gauss":
            return gauss_steps(spans.start, spans.end, method.steps)
        row, column = (part[:, None] for part in np.divmod(spans.ray, self.width))
        number = np.arange(method.steps)
        if method.quadrature == "jittered":
            offset = hashed(column, row, spans.number * method.steps + number, method.seed)
        elif method.jitter:
            offset = np.repeat(hashed(column, row, np.zeros(1, dtype=np.int64), method.seed), method.steps, axis=1)
        else:
            offset = np.full((len(spans.ray), method.steps), 0.0 if method.quadrature == "left" else 0.5)
        light = terms.variable
        return even_steps(lambda u: light_variable(light, self.rays, spans.ray, spans.start, spans.end, u), offset)

    def _sampled(self, spans: _Spans, at: Array, terms: _Terms) -> tuple[Array, Array]:
        """Extinction and source term at samples (k, p): (k, p, 3) each."""
        volume = self.paths.volume
        owner = self._segment_at(spans, at).ravel()
        some = np.flatnonzero(owner >= 0)
        ray = np.repeat(spans.ray, at.shape[1])[some]
        points = points_on(self.rays, ray, at.ravel()[some])
        weights = volume.at(self.media.filling[owner[some]], points)
        extinction, source = np.zeros((2, at.size, 3))
        extinction[some] = weights @ volume.extinction
        if terms.emission:
            source[some] = weights @ volume.emission
        for light in terms.lights:
            scattered, sound = light_source(self.paths, light, weights, points, self.rays.directions[ray])
            source[some] += scattered
            self.sound[ray[~sound]] = False
        return extinction.reshape(*at.shape, 3), source.reshape(*at.shape, 3)

    def _segment_at(self, spans: _Spans, at: Array) -> Integers:
        """(k, p): the segment in which each sample is; -1 outside of all."""
        if spans.segments is not None:
            return np.broadcast_to(spans.segments[:, None], at.shape)
        segments = self.media.segments
        found = np.full(at.shape, -1)
        row = np.full(len(self.rays), -1)
        row[spans.ray] = np.arange(len(spans.ray))
        for layer in _layers(segments.pixel):
            owner = layer[row[segments.pixel[layer]] >= 0]
            rows = row[segments.pixel[owner]]
            inside = (at[rows] >= segments.t_enter[owner, None]) & (at[rows] < segments.t_exit[owner, None])
            found[rows] = np.where(inside, owner[:, None], found[rows])
        return found


def _slices(spans: _Spans, steps: int) -> Iterator[_Spans]:
    """Parts of the spans with at most `SAMPLES` samples, or of one span."""
    most = max(SAMPLES // steps, 1)
    for begin in range(0, len(spans.ray), most):
        yield spans.where(slice(begin, begin + most))
