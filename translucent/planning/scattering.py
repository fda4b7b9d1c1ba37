"""Ways to show light that media scatter, and the choice among them for each body of a scene."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from translucent.arguments import brief, checked
from translucent.arrays import Array
from translucent.errors import InputError
from translucent.media.medium import Medium
from translucent.planning.bodies import MAX_SLOTS, medium_slots
from translucent.planning.methods.base import MAX_LIGHT_POINTS, check_count
from translucent.planning.rendered import Treatment, treated
from translucent.scene.grounds import ground_below
from translucent.scene.lights import PositionalLight, SpotLight
from translucent.scene.scene import Object, Scene


@dataclass(frozen=True)
class Scattering:
    """A method to render light that media scatter more than once; see its subclasses.

    Attributes
    ----------
    name : str
        On the command line.
    multiple : bool
        Shows light that is scattered many times.
    """

    name: ClassVar[str] = ""
    multiple: ClassVar[bool] = False

    def refusal(self, body: Object) -> str | None:
        """Reason why this model cannot render a body; None if it can."""
        return None


#: Resolutions that make sense: below, no body has an inside; above, more memory is needed, as the error says.
LEAST_RESOLUTION, MOST_RESOLUTION = 8, 128

#: Resolution from which on solutions are corrected by uniform light. At 12, pixels of milk, jade and wax in bear and
#: candle change by less than 0.5 of 255 by that, and are 0.5 to 5.6 off those at 32.
LEAST_CORRECTED = 16

#: Thickness in cells, everywhere, of the thinnest bodies in which light diffuses: as slabs.
LEAST_WALL = 0.25

#: Cells in the bounds of a body, most of them empty; each takes about 150 bytes.
MOST_IN_BOX = 2_000_000

#: Bytes that a cell takes, with its part of samples on the surface and of what they see.
CELL_BYTES = 4000


@checked
@dataclass(frozen=True)
class Diffusion(Scattering):
    """Light scattered many times, as it diffuses in the body and leaves through its surface.

    The diffusion equation on cells that the mesh cuts, lit by what enters: the environment and lights, shadowed by the
    body and by opaque objects, and light of the body that falls on it again. Solved on the CPU where the light, the
    medium or the mesh changes; a picture then takes two look-ups. Light that passes unscattered is seen along rays as
    ever. Where the density varies, it does so from cell to cell. Without an interface, as in clouds, rays gather what
    is scattered into them on their path, from a solution by discrete ordinates that diffusion accelerates.

    Parameters
    ----------
    resolution : int
        A body gets about resolution^3 / 4 cells, whatever its shape, 8 to 128: a ball is 0.8 times as many cells wide.
    """

    name: ClassVar[str] = "diffusion"
    multiple: ClassVar[bool] = True

    resolution: int = 32

    def __post_init__(self) -> None:
        if isinstance(self.resolution, int) and self.resolution > MOST_RESOLUTION:
            cells = 0.25 * min(self.resolution, 10**9) ** 3
            raise InputError(
                f"Diffusion resolution {brief(self.resolution)}",
                (
                    f"at this resolution, a body would have {cells:.2g} cells and take about "
                    f"{CELL_BYTES * cells / 1e9:.0f} GB of memory"
                ),
                f"use at most {MOST_RESOLUTION}; 32 is enough for media that mainly scatter",
            )
        check_count("Diffusion resolution", self.resolution, MOST_RESOLUTION, least=LEAST_RESOLUTION, example=32)

    @property
    def corrected(self) -> bool:
        """True if the solution is corrected by uniform light, which takes as long as all else: not on coarse grids,
        whose other errors are five times as large, or more.
        """
        return self.resolution >= LEAST_CORRECTED

    @checked
    def cell_size(self, body: Object) -> float:
        """Side of a cell in metres."""
        volume = abs(body.mesh.volume * float(np.linalg.det(body.matrix[:3, :3])))
        return float(np.cbrt(4.0 * volume) / self.resolution)

    def refusal(self, body: Object) -> str | None:
        """Reason: no closed solid wound outwards, or much thinner than a cell everywhere."""
        if body.sheet_thickness is not None:
            return "the body is a sheet"
        if not body.mesh.diagnosis.sound:
            return "the mesh is not closed"
        if not body.mesh.volume > 0.0:
            return "the mesh is inside out"
        step = self.cell_size(body)
        if (box := float(np.prod(_own_extent(body) / step + 2.0))) > MOST_IN_BOX:
            return f"the bounding box, mostly empty, would need {box:.2g} cells of {step:.2g} m"
        # Rays that gather light on their path find it in cells alone.
        least = 1.0 if body.density is not None or (body.medium is not None and _is_volume(body, self)) else LEAST_WALL
        if body.mean_thickness < least * step:
            return f"the body is everywhere thinner than {least:g} cells of {step:.2g} m"
        return None


def _own_extent(body: Object) -> Array:
    """(3,): sides in metres of the bounds of a body in its own frame, in which its grid is: without its rotation."""
    linear = body.matrix[:3, :3]
    _, sizes, axes = np.linalg.svd(linear)
    return np.asarray(np.ptp(body.mesh.vertices @ (axes.T * sizes) @ axes, axis=0))


@dataclass(frozen=True)
class ScatteringLayer(Scattering):
    """Light scattered many times as from a flat layer as thick as the body along the ray, between two interfaces.

    The layer of Kubelka and Munk (1931) with the inner mirrors of its interfaces (Saunderson 1942): exact for a wide
    flat slab in diffuse light. Light does not spread sideways, and nothing shadows it.
    """

    name: ClassVar[str] = "layer"
    multiple: ClassVar[bool] = True

    def refusal(self, body: Object) -> str | None:
        """Reason: the density varies."""
        return None if body.density is None else "the density varies"


@checked
@dataclass(frozen=True)
class SingleScattering(Scattering):
    """Single scattering of lights into each ray; light that is scattered again is lost.

    Exact for thin smoke and clear drinks. In wax or milk nearly all light is scattered more often: they come out dark.

    Parameters
    ----------
    points : int
        On each interval, at which each light is looked at; a method that is requested has its own.
    """

    name: ClassVar[str] = "single"

    points: int = 8

    def __post_init__(self) -> None:
        check_count("SingleScattering points", self.points, MAX_LIGHT_POINTS)


__all__ = ["SCATTERINGS", "Diffusion", "Scattering", "ScatteringLayer", "SingleScattering"]

#: Names on the command line.
SCATTERINGS: dict[str, type[Scattering]] = {one.name: one for one in (Diffusion, ScatteringLayer, SingleScattering)}


#: Least scattering across a body, sigma_s times its mean thickness, at which the planner shows more than what single
#: scattering does: of the environment's light, that is nothing, and what goes on ahead is lost, too.
LEAST_DEPTH = 0.01

#: Reduced optical depth of the mean thickness from which on a body without an interface that stands on a ground is lit
#: by it. Measured on balls over gray and white grounds, of depths 0.1 to 3.3 and mean cosines 0.3 to 0.85: rays in a
#: volume, which know no ground, are 15 to 45 % too dark. Surfaces are up to 7 % off, and 20 % where thin fog scatters
#: ahead.
LEAST_LIT_DEPTH = 0.1

#: Optical depth across a cell from which on light of a body of one density leaves through its surface.
MOST_CELL_DEPTH = 1.0

#: Bodies in which light diffuses unless it is requested: each takes its tenths of a second and its part of a
#: texture.
MOST_DIFFUSED = 32

#: Reason against light scattered again where density varies.
_NO_STEPS = "the density varies, so light needs ray marching (OpenGL 4.3 and RayMarched)"


@dataclass(frozen=True)
class Treatments:
    """Treatments of the bodies of a scene that show light which they scatter many times.

    Attributes
    ----------
    of : dict of int to Treatment
        By the number of the object.
    diffusion : Diffusion
        Of those in which light diffuses.
    refusals : tuple of (int, str)
        Objects that are layers since light cannot diffuse in them, and why.
    """

    of: dict[int, Treatment] = field(default_factory=dict)
    diffusion: Diffusion = field(default_factory=Diffusion)
    refusals: tuple[tuple[int, str], ...] = ()


def choose_treatments(
    scene: Scene, requested: Scattering | None, *, layers: bool = True, matched: bool = True, volumes: bool = True
) -> Treatments:
    """Choose how the bodies of a scene show light that they scatter many times.

    Unless it is requested, bodies that scatter little do not show any.

    Parameters
    ----------
    scene : Scene
    requested : Scattering, optional
    layers : bool
        Bodies can be shown as layers.
    matched : bool
        Bodies without an interface can show it, too.
    volumes : bool
        Rays can gather it on their path through them; else it leaves through their surface.

    Raises
    ------
    InputError
        If what is requested can be done for none of the bodies that scatter.
    """
    if requested is not None and not requested.multiple:
        return Treatments()
    chosen = Diffusion() if requested is None else requested
    bodies = {
        i: body
        for i, body in enumerate(scene.objects)
        if body.medium is not None
        and body.medium.scatters
        and not body.covers
        and (body.has_interface or matched)
        and (requested is not None or _is_deep(body, body.medium))
    }
    refused = {i: why for i, body in bodies.items() if (why := chosen.refusal(body)) is not None}
    if not volumes:
        refused |= {i: _NO_STEPS for i, body in bodies.items() if _is_cloud(body)}
    if requested is None and len(bodies) - len(refused) > MOST_DIFFUSED:
        many = f"more than {MOST_DIFFUSED} bodies would need diffusion, which takes long"
        refused = dict.fromkeys(bodies, many) | refused
    layer, of = ScatteringLayer(), dict[int, Treatment]()
    for i, body in bodies.items():
        if layers and (i in refused or chosen == layer) and layer.refusal(body) is None:
            of[i] = Treatment.LAYER
        elif i not in refused and isinstance(chosen, Diffusion):
            of[i] = Treatment.DIFFUSION
    if requested is not None and bodies and not of:
        i = next(iter(bodies))
        why = refused.get(i, "this renderer has no flat layers")
        raise InputError(str(requested), f"{scene.objects[i].mesh.name!r}: {why}", "use SingleScattering() instead")
    if not isinstance(chosen, Diffusion):
        return Treatments(of)
    if volumes:
        solved = [i for i, treatment in of.items() if treatment is Treatment.DIFFUSION]
        of |= dict.fromkeys(_volumes(scene, solved, chosen), Treatment.VOLUME)
    layered = tuple((i, why) for i, why in refused.items() if of.get(i) is Treatment.LAYER)
    return Treatments(of, chosen, layered)


def rendered_scene(scene: Scene, treatments: Treatments) -> Scene:
    """Scene as it is rendered: bodies with their treatments, and media that emit the ambient radiance they scatter."""
    objects = list(scene.objects)
    for i, item in enumerate(objects):
        treatment = treatments.of.get(i, Treatment.SINGLE)
        if (medium := item.medium) is None:
            continue
        if treatment is Treatment.DIFFUSION:
            straight = Medium(medium.extinction, emission=scene.source(item), ior=medium.ior)
            objects[i] = treated(item, treatment, straight, medium)
        elif scene.scatters_ambient and medium.scatters:
            objects[i] = treated(item, treatment, replace(medium, emission=scene.source(item)))
        elif treatment is not Treatment.SINGLE:
            objects[i] = treated(item, treatment, medium)
    # A scene of its own in any case, lest plans that are kept for a scene keep it.
    if all(item is given for item, given in zip(objects, scene.objects, strict=True)):
        return copy.copy(scene)
    return replace(scene, objects=objects, ambient=(0.0, 0.0, 0.0))


def _volumes(scene: Scene, solved: list[int], chosen: Diffusion) -> tuple[int, ...]:
    """Bodies with in-scattered light, as far as each can have winding numbers of its own."""
    varying = tuple(i for i in solved if _is_cloud(scene.objects[i]))
    even = tuple(
        i
        for i in solved
        if scene.objects[i].density is None and _is_volume(scene.objects[i], chosen) and not _is_lit_by_ground(scene, i)
    )
    fogs = varying + even
    return fogs if not fogs or len(medium_slots(scene, apart=fogs)) <= MAX_SLOTS else varying


def _is_cloud(body: Object) -> bool:
    return body.density is not None and not body.has_interface


def _is_deep(body: Object, medium: Medium) -> bool:
    densest = 1.0 if body.density is None else body.density.maximum
    return bool(np.asarray(medium.scattering).max() * densest * body.mean_thickness > LEAST_DEPTH)


def _is_lit_by_ground(scene: Scene, body: int) -> bool:
    """True if light from the ground matters more than the error of a surface treatment.

    Not where it shows beams, or is viewed from within: those are in its volume.
    """
    item, (low, high) = scene.objects[body], scene.boxes[body]
    assert item.medium is not None

    def inside(point: Array) -> bool:
        return bool((point > low).all() and (point < high).all())

    if inside(scene.camera.eye) or any(
        isinstance(light, SpotLight) or (isinstance(light, PositionalLight) and inside(np.asarray(light.position)))
        for light in scene.lights
    ):
        return False
    depth = float(_reduced_extinction(item.medium).max()) * item.mean_thickness
    return depth > LEAST_LIT_DEPTH and ground_below(scene, [body]) is not None


def _reduced_extinction(medium: Medium) -> Array:
    return np.asarray(medium.absorption) + np.asarray(medium.scattering) * (1.0 - medium.anisotropy)


def _is_volume(body: Object, chosen: Diffusion) -> bool:
    """True if light is gathered along rays in a homogeneous body, because rays see deeper than one cell."""
    if body.has_interface:
        return False
    assert body.medium is not None
    return float(_reduced_extinction(body.medium).max()) * chosen.cell_size(body) < MOST_CELL_DEPTH
