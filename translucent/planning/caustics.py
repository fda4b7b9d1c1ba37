"""Caustics by photons: the request, their passes, and the bodies at which each light aims."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from translucent.arguments import checked
from translucent.arrays import Array
from translucent.errors import InputError
from translucent.formulas.light import ALL_AROUND
from translucent.formulas.phase import ISOTROPIC
from translucent.planning.bodies import count_of, indices, varies_at_hits
from translucent.planning.methods import Method
from translucent.planning.methods.base import EMBREE_COST, HITS, check_count
from translucent.planning.passes import Note, NoteKind, PassName, PassSpec
from translucent.scene.lights import DirectionalLight, PositionalLight, with_whole_spheres
from translucent.scene.scene import Light, Object, Scene, object_names

#: Largest number of photons of a frame: a software rasterizer follows so many in some minutes.
MAX_PHOTONS = 1 << 30

#: Photons in media, least and most: each of them lights all cells on its path.
LEAST_IN_MEDIA, MOST_IN_MEDIA = 1 << 16, 1 << 18


@checked
@dataclass(frozen=True)
class Caustics:
    """Light of the lights of a scene that interfaces bend and mirror onto opaque objects and media, by photons.

    Photons (Jensen 1996) leave the lights towards the bodies. Interfaces refract or reflect them in the proportions of
    Fresnel's equations, and photons of the same branches are spread as evenly as all; media absorb along the path.
    Refracted or reflected photons land on the first opaque surface, and are drawn into the picture of the opaque
    objects (McGuire & Luebke 2009), each divided by the area that its pixel covers there. Each is a square that takes
    the space of some photons there, up to a pixel wide (photon differentials, Schjoeth et al. 2007); where there
    are few, they are spread over some pixels. Surfaces reflect them diffusely. The energy is right whatever their
    number; the noise of a pixel falls with its square root. Of several samples of a pixel each follows its part of the
    photons.

    Others (`in_media`) are followed into bodies in which light diffuses, and light fog all along their paths.

    The straight light of the lights ends at solids that bend light (`RenderPlan.opaque_to_shadows`).

    Interfaces show caustics behind them wherever the picture shows the receiver without them.

    Parameters
    ----------
    photons : int
        Of a frame, up to 2^30; 0 for none, also where the planner would choose some.
    seed : int
        Of the random numbers, 0 to 2^32 - 1.

    Raises
    ------
    InputError
        If a value is not one of these.
    """

    photons: int = 1_000_000
    seed: int = 0

    #: Time of a million photons, in multiples of drawing the bodies into a depth buffer, as measured on a software
    #: rasterizer: 2,600 through a ball, 5,400 through a goblet with wine.
    cost_of_a_million: ClassVar[float] = 4000.0

    def __post_init__(self) -> None:
        check_count("Caustics photons", self.photons, MAX_PHOTONS, least=0, example=1_000_000)
        check_count("Caustics seed", self.seed, (1 << 32) - 1, least=0, example=0)

    @property
    def in_media(self) -> int:
        """Photons, of others than land on opaque objects, that light media: a quarter as many, within bounds."""
        return min(max(self.photons // 4, LEAST_IN_MEDIA), MOST_IN_MEDIA)

    def __str__(self) -> str:
        return f"Caustics(photons={self.photons}, seed={self.seed})"


#: Time of a photon in media for each object of the scene, which are searched one after the other, in seconds of a
#: processor core: through a ball of glass into fog, measured on two busy cores.
SECONDS_OF_A_PHOTON = 2.5e-5

#: Passes that show light of media: the reason of the first one in a plan names the photons in them.
_CARRYING = PassName.LIGHT_VIEWS, PassName.TRACED, PassName.SURFACES


#: Seconds of a processor core on a software rasterizer, to be compared with each other: a sample of a pixel, and each
#: light on it; a photon that shaders follow; and in each of four samples a pixel of what photons land on.
PIXEL_SAMPLE, LIGHT_SAMPLE, PHOTON, RECEIVER = 3.1e-7, 3.4e-7, 2.3e-6, 4.2e-7

#: Samples that have photons, at most.
PHOTON_SAMPLES = 4

#: Part of the time of a picture that photons may take unrequested, and how many each pixel gets then, least and most.
UNREQUESTED, PHOTONS_OF_A_PIXEL = 1.0 / 3.0, (1.0, 4.0)


def affordable_caustics(scene: Scene, samples: int, pixels: int, *, embree: bool) -> Caustics | None:
    """Default caustics of a picture; None if they would take more than a third of its time.

    Estimated is the time of s samples of P pixels with L lights, s P (a + b L), against that of N photons in r samples,
    r P c + N d, as measured: `PIXEL_SAMPLE`, `LIGHT_SAMPLE`, `RECEIVER`, `PHOTON`.

    Parameters
    ----------
    scene : Scene
        With points in place of sphere lights.
    samples : int
    pixels : int
        Of the picture; 0 if they are not known.
    embree : bool
        Embree finds what photons hit.
    """
    if not pixels or scene.camera.window is not None or not gathers_light(scene):
        return None
    allowed = UNREQUESTED * samples * (PIXEL_SAMPLE + LIGHT_SAMPLE * len(scene.lights))
    photon = PHOTON * (EMBREE_COST if embree else 1.0)
    least, most = PHOTONS_OF_A_PIXEL
    each = min((allowed - min(samples, PHOTON_SAMPLES) * RECEIVER) / photon, most)
    return Caustics(min(round(each * pixels), MAX_PHOTONS)) if each >= least else None


def opaque_to_shadows(scene: Scene) -> frozenset[int]:
    """Numbers of the objects whose refraction replaces straight shadows by photons."""
    return frozenset(
        i for i, body in enumerate(scene.objects) if _redirects_light(body) and body.sheet_thickness is None
    )


def lit_by_photons(scene: Scene, solved: Iterable[int]) -> tuple[int, ...]:
    """Bodies in which light diffuses, by their numbers, into which others bend some."""
    bending = opaque_to_shadows(scene)
    return tuple(i for i in solved if bending - {i})


def check_caustics(scene: Scene, method: Method | None, lit: tuple[int, ...]) -> None:
    """Raise `InputError` if no photon could land, or the method that is requested follows none.

    `lit`: numbers of the bodies into which photons carry light.
    """
    if method is not None and (method.follows_paths or method.makes_sheets):
        found = (
            "this method does not show caustics on opaque objects behind interfaces"
            if method.follows_paths
            else "this method treats every face as a sheet, which does not refract light"
        )
        raise InputError(f"caustics with {method}", found, "omit the caustics, or choose another method")
    _check_paths(scene, lit)


def passes_with_caustics(
    passes: tuple[PassSpec, ...], scene: Scene, caustics: Caustics, lit: tuple[int, ...], hits: str, why: str
) -> tuple[PassSpec, ...]:
    """The passes of a plan in their order, with the passes that photons need; `hits` is what finds their surfaces."""
    names = [one.name for one in passes]
    carries = next((name for name in _CARRYING if name in names), None)
    steps: list[PassSpec] = []
    for one in passes:
        steps.append(_into_media(one, scene, lit, caustics) if lit and one.name is carries else one)
        if one.name is PassName.OPAQUE:
            opaque = indices(scene, lambda item: item.medium is None)
            cost = caustics.cost_of_a_million * caustics.photons / 1e6 * (EMBREE_COST if hits == "embree" else 1.0)
            reason = f"{_landing(scene, caustics, why)}; {HITS[hits]} finds the hits"
            steps.append(PassSpec(PassName.CAUSTICS, reason, opaque, 1, cost=cost))
        elif one.name is PassName.SHADE and scene.opaque:
            steps[-1] = _shaded_with(steps[-1], scene, caustics, why)
    return tuple(steps)


def _shaded_with(step: PassSpec, scene: Scene, caustics: Caustics, why: str) -> PassSpec:
    """Pass that shades opaque objects without OpenGL, with the photons that land on them."""
    seconds = caustics.photons * SECONDS_OF_A_PHOTON * len(scene.objects)
    landed = f"{_landing(scene, caustics, why)}; the CPU traces them in about {seconds:.2g} s"
    return replace(step, reason=f"{step.reason}; {landed}")


def _landing(scene: Scene, caustics: Caustics, why: str) -> str:
    return (
        f"{why}: {caustics.photons:,} photons from {count_of(tuple(range(len(scene.lights))), 'light', 'lights')} "
        f"through {_bending(scene)}, added to the diffuse reflection of opaque objects"
    )


def _into_media(step: PassSpec, scene: Scene, lit: tuple[int, ...], caustics: Caustics) -> PassSpec:
    """Pass that shows light of media, with the photons that carry it there."""
    seconds = caustics.in_media * SECONDS_OF_A_PHOTON * len(scene.objects)
    reason = (
        f"{step.reason}; requested: {caustics.in_media:,} photons carry light through {_bending(scene)} into "
        f"{_names(scene, lit)}; the CPU traces them in about {seconds:.2g} s, and again only if objects or lights "
        "change"
    )
    return replace(step, reason=reason)


def _bending(scene: Scene) -> str:
    return _names(scene, indices(scene, _redirects_light))


def _names(scene: Scene, numbers: tuple[int, ...]) -> str:
    return object_names([scene.objects[i] for i in numbers])


def _redirects_light(body: Object) -> bool:
    """True if interfaces of an object bend or mirror light."""
    return body.medium is not None and body.has_interface and body.medium.ior != 1.0


def _check_paths(scene: Scene, lit: tuple[int, ...]) -> None:
    """Refuse a scene in which no photon could land."""
    if not scene.lights:
        do = "add a tl.PointLight, tl.SpotLight or tl.DirectionalLight; light of the environment makes no caustics"
        raise InputError("caustics", "the scene has no lights that can emit photons", do)
    if not any(_redirects_light(body) for body in scene.objects):
        found = f"no interface of {object_names(scene.bodies)} refracts or reflects light"
        raise InputError("caustics", found, "give a medium an index of refraction: ior=1.5")
    if not scene.opaque and not lit:
        found = "no opaque object and no scattering body can receive the light"
        raise InputError("caustics", found, "add a ground: tl.Object(mesh)")
    if uneven := [body for body in scene.bodies if body.density is not None]:
        found = f"the density of {object_names(uneven)} varies, but photons need media of constant density"
        raise InputError("caustics", found, "omit the caustics, or give these bodies the same density everywhere")
    if rough := [
        body
        for body in scene.bodies
        if body.sheet_thickness is not None and body.surface is not None and body.surface.roughness > 0.0
    ]:
        found = f"{object_names(rough)}: photons cannot cross a rough sheet"
        raise InputError("caustics", found, "use a closed body instead of the sheet, or a sheet without roughness")


def gathers_light(scene: Scene) -> bool:
    """True if clear bodies bend light of lights onto opaque objects, and photons are followed by OpenGL alone."""
    refused = [body for body in scene.bodies if body.density is not None or body.covers or body.sheet_thickness]
    scatters = any(body.medium is not None and body.medium.scatters for body in scene.bodies)
    return bool(scene.lights and caustics_to_request(scene)) and not refused and not scatters


def caustics_to_request(scene: Scene, do: str = "add --caustics (tl.Caustics())") -> tuple[Note, ...]:
    """Note on light that clear bodies focus onto opaque objects; photons would show that of lights.

    Parameters
    ----------
    scene : Scene
    do : str
        What shows the caustics of lights.
    """
    clear = [
        body
        for body in scene.bodies
        if _redirects_light(body)
        and body.sheet_thickness is None
        and body.density is None
        and body.medium is not None
        and not body.medium.scatters
    ]
    if not clear or not scene.opaque:
        return ()
    if not scene.lights:
        if not scene.environment_shadows:
            return ()
        text = (
            f"light of the environment that {object_names(clear)} focuses is missing, below a sun a spot several times "
            "as bright as the ground; tl.PathTraced renders it"
        )
        return (Note(NoteKind.CAUSTICS, text),)
    text = (
        f"the caustic in the shadow of {object_names(clear)} is missing, a spot several times as bright as the "
        f"ground: {do}"
    )
    return (Note(NoteKind.CAUSTICS, text),)


def caustics_left_out(scene: Scene, lit: tuple[int, ...], fogs: tuple[int, ...], opengl: bool) -> tuple[Note, ...]:
    """Notes on light that photons do not carry."""
    texts = ["the environment causes no caustics"]
    if opengl:
        hidden = "outside the picture or behind opaque objects"
        texts.append(f"no caustics on objects that are visible only through interfaces, {hidden}")
    dark = indices(scene, lambda body: body.medium is not None and body.medium.scatters)
    uneven = indices(scene, lambda body: body.medium is not None and body.medium.phase_function != ISOTROPIC)
    if others := tuple(i for i in dark if i not in lit):
        texts.append(f"no caustics in these scattering media: {_names(scene, others)}")
    if dark:
        texts.append("photons that a medium scatters are lost")
    if aside := tuple(i for i in fogs if i in uneven):
        texts.append(f"{_names(scene, aside)}: caustic light is scattered equally in all directions")
    textured = indices(scene, lambda body: body.has_interface and varies_at_hits(body))
    if textured and (fogs or not opengl):
        texts.append(f"{_names(scene, textured)}: photons on the CPU ignore the textures of these interfaces")
    return tuple(Note(NoteKind.CAUSTICS, text) for text in texts)


#: Factor by which a rectangle is larger than what it holds: of rounding.
_MARGIN = 1.001

#: Largest tangent of the angle off its axis at which a point light sees bodies for which rectangles are aimed at;
#: beyond, as for a light among them, photons leave in all directions.
_WIDEST = 3.0


@dataclass(frozen=True, eq=False)
class PhotonAim:
    """Aim of a light at a rectangle; lengths in metres from the center of the media.

    Attributes
    ----------
    light : (4,) float64
        Position, and 1; or the direction in which light travels, and 0.
    middle, right, up : (3,) float64
        Of the rectangle, and half its sides; these are 0 where photons leave in all directions.
    flux : (3,) float64
        Of a directional light through the rectangle, or of a light as bright in all directions, in W; of a light
        that aims at a rectangle, to be multiplied by the cosine over the squared distance.
    weight : float
        Fraction of the photons, up to a factor.
    cone : (4,) float64
        In which the light shines, as `translucent.formulas.light.cone_attenuation` takes it.
    inside : tuple of int
        Numbers of the bodies that the light is in.
    light_radius : float
        Of the sphere that the light is, in metres, in which photons begin anywhere; 0 for a light without size.
    photons : int
        How many leave.
    """

    light: Array
    middle: Array
    right: Array
    up: Array
    flux: Array
    weight: float
    cone: Array = field(default_factory=lambda: np.array(ALL_AROUND))
    inside: tuple[int, ...] = ()
    light_radius: float = 0.0
    photons: int = 0


def photon_aims(scene: Scene, center: Array, photons: int) -> list[PhotonAim]:
    """Aims of all lights at the bodies whose interfaces may redirect light, with about so many photons in all.

    Parameters
    ----------
    scene : Scene
    center : (3,) float64
        From which positions count, in metres.
    photons : int
        Divided by the power that aims carry; each has one at least.
    """
    turning = indices(scene, lambda body: body.has_interface or _displaces(scene, body))
    clouds = [_corners(scene.objects[number], center) for number in turning]
    lights = with_whole_spheres(scene.lights)
    aims = [aim for light in lights for aim in _aims(scene, light, clouds, center) if aim.weight > 0.0]
    total = sum(aim.weight for aim in aims)
    return [replace(aim, photons=max(round(photons * aim.weight / total), 1)) for aim in aims]


def _displaces(scene: Scene, body: Object) -> bool:
    """True if a body without an interface of its own may have one where it displaces another."""
    if scene.overlap != "priority" or body.medium is None or body.sheet_thickness is not None:
        return False
    return any(other.has_interface and other.priority <= body.priority for other in scene.bodies if other is not body)


def _corners(body: Object, center: Array) -> Array:
    """(n, 3): corners of the faces of a body."""
    used = np.unique(body.mesh.faces)
    return np.asarray(body.mesh.vertices[used] @ body.matrix[:3, :3].T + (body.matrix[:3, 3] - center))


def _aims(scene: Scene, light: Light, clouds: list[Array], center: Array) -> list[PhotonAim]:
    low, high = np.min([c.min(axis=0) for c in clouds], axis=0), np.max([c.max(axis=0) for c in clouds], axis=0)
    middle = 0.5 * (low + high)
    if isinstance(light, DirectionalLight):
        direction = np.asarray(light.direction)
        across = _across(direction)
        from_light, aims = np.array([*direction, 0.0]), []
        for low, high in _apart([_bounds((corners - middle) @ across.T) for corners in clouds]):
            at, right, up, area = _rectangle(low, high, middle, across)
            flux = np.asarray(light.irradiance) * area
            aims.append(PhotonAim(from_light, at, right, up, flux, float(flux.mean())))
        return aims
    assert isinstance(light, PositionalLight)
    # Photons begin anywhere in the whole sphere, and not in the part of it that one of its points is.
    place = np.asarray(light.position) + light.disc[:3]
    return _point_aims(scene, light, clouds, middle, place - center, place)


def _point_aims(
    scene: Scene, light: PositionalLight, clouds: list[Array], middle: Array, at: Array, place: Array
) -> list[PhotonAim]:
    """Aims of a light at `place` in the world, `at` from the center."""
    inside = tuple(
        i
        for i, item in enumerate(scene.objects)
        if item.medium is not None and item.sheet_thickness is None and abs(item.winding_number(place)) > 0.75
    )
    intensity, away = np.asarray(light.intensity), float(np.linalg.norm(middle - at))
    position = np.array([*at, 1.0])
    bounds = None if inside or away == 0.0 else _visible_bounds(clouds, middle, at, away, light.disc[3])
    if bounds is None:
        flux, none = 4.0 * np.pi * intensity, np.zeros(3)
        weight = float(flux.mean()) * light.mean_share
        return [PhotonAim(position, middle, none, none, flux, weight, light.cone, inside, light.disc[3])]
    aims, across = [], _across((middle - at) / away)
    for low, high in _apart(bounds):
        aimed, right, up, area = _rectangle(low, high, middle, across)
        flux = intensity * area
        weight = float(flux.mean()) * away / float(np.linalg.norm(aimed - at)) ** 3
        aims.append(PhotonAim(position, aimed, right, up, flux, weight, light.cone, inside, light.disc[3]))
    return aims


def _visible_bounds(clouds: list[Array], middle: Array, at: Array, away: float, radius: float) -> list[Array] | None:
    """Bounds (2, 2) of bodies, as seen from a ball around `at` on the plane across the line to their `middle`; None if
    they are all around.
    """
    axis, across, found = (middle - at) / away, _across((middle - at) / away), []
    for corners in clouds:
        ahead = ((corners - at) @ axis)[:, None]
        if not (ahead > radius).all():
            return None
        aside = (corners - at) @ across.T
        # Slopes of the lines from a corner that touch the ball, in the plane of the axis and each vector across it.
        angle, spread = np.arctan2(aside, ahead), np.arcsin(radius / np.hypot(ahead, aside))
        slopes = np.tan(np.stack([angle - spread, angle + spread]))
        if (np.abs(angle) + spread > np.arctan(_WIDEST)).any():
            return None
        found.append(_bounds((aside + (away - ahead) * slopes).reshape(-1, 2)))
    return found


def _bounds(places: Array) -> Array:
    """(2, 2): smallest and largest of places (n, 2), with a margin."""
    low, high = places.min(axis=0), places.max(axis=0)
    half, mean = 0.5 * _MARGIN * (high - low), 0.5 * (low + high)
    return np.stack([mean - half, mean + half])


def _apart(boxes: list[Array]) -> list[Array]:
    """Boxes (2, 2), joined until no two overlap, so that no light passes two of them."""
    found: list[Array] = []
    waiting = list(boxes)
    while waiting:
        box = waiting.pop()
        overlapping = [i for i, other in enumerate(found) if (box[0] < other[1]).all() and (other[0] < box[1]).all()]
        if not overlapping:
            found.append(box)
            continue
        parts = np.stack([box, *(found[i] for i in overlapping)])
        found = [other for i, other in enumerate(found) if i not in overlapping]
        waiting.append(np.stack([parts[:, 0].min(axis=0), parts[:, 1].max(axis=0)]))
    return found


def _across(axis: Array) -> Array:
    """(2, 3): unit vectors across an axis and each other."""
    right = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(right, axis)])


def _rectangle(low: Array, high: Array, middle: Array, across: Array) -> tuple[Array, Array, Array, float]:
    """Middle, half sides, and area of a rectangle that reaches from `low` to `high` (2,) along two vectors (2, 3)."""
    half, mean = 0.5 * (high - low), 0.5 * (low + high)
    return middle + mean @ across, half[0] * across[0], half[1] * across[1], float(np.prod(high - low))
