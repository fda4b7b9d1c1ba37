"""Choice of the way in which each body shows what it scatters many times: as asked for, or by the planner."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from weakref import WeakKeyDictionary

import numpy as np

from translucent.arguments import brief
from translucent.errors import InputError
from translucent.media.given_back import DiffusedMedium, DiffusedVolume, LayeredMedium
from translucent.media.medium import Medium
from translucent.planning.scattering import Diffusion, Scattering, ScatteringLayer, SingleScattering
from translucent.planning.slots import MAX_SLOTS, medium_slots
from translucent.scene.scene import Object, Scene

#: Least reduced scattering across a body, sigma_s' times its mean thickness, at which the planner shows more than what
#: single scattering does: of the environment's light, that is nothing.
LEAST_DEPTH = 0.01

#: Optical depth across a cell from which on light of a body of one density leaves through its surface.
MOST_CELL_DEPTH = 1.0

#: Bodies in which light diffuses unless asked for: each takes its tenths of a second and its share of a texture.
MOST_DIFFUSED = 32

#: Reason against light scattered again where density varies.
_NO_STEPS = "its density varies, and no steps of a ray gather its light: that takes OpenGL 4.3 and RayMarched"


@dataclass(frozen=True)
class GivenBack:
    """Bodies of a scene that give back light which they scatter many times.

    Attributes
    ----------
    diffused : tuple of int
        Numbers of the objects in which light diffuses.
    layered : tuple of int
        Of those that give back light as layers.
    volumes : tuple of int
        Of those without an interface, into whose rays light is scattered again.
    diffusion : Diffusion
    refusals : tuple of (int, str)
        Objects that are layers since light cannot diffuse in them, and why.
    """

    diffused: tuple[int, ...] = ()
    layered: tuple[int, ...] = ()
    volumes: tuple[int, ...] = ()
    diffusion: Diffusion = field(default_factory=Diffusion)
    refusals: tuple[tuple[int, str], ...] = ()

    def __bool__(self) -> bool:
        """True if there are any."""
        return bool(self.diffused or self.layered or self.volumes)

    @property
    def solved(self) -> bool:
        """True if light is solved for on a grid."""
        return bool(self.diffused or self.volumes)

    def __str__(self) -> str:
        ways = (
            (self.diffused, f"diffuses ({self.diffusion})"),
            (self.volumes, f"is scattered on ({self.diffusion})"),
            (self.layered, "is given back as by layers"),
        )
        return ", and ".join(
            f"{way} in {len(bodies)} {'body' if len(bodies) == 1 else 'bodies'}" for bodies, way in ways if bodies
        )


#: Where media show what they scatter once, and no more.
NOTHING_GIVEN_BACK = GivenBack()


def check_scattering(scattering: object) -> None:
    """Raise `InputError` for what is no choice of scattering."""
    if scattering is None or isinstance(scattering, Scattering):
        return
    known = [f"tl.{one}" for one in (Diffusion(), ScatteringLayer(), SingleScattering())]
    raise InputError(
        f"scattering {brief(scattering)}",
        "not a choice of scattering",
        f"give {', '.join(known[:-1])} or {known[-1]}",
    )


def given_back(
    scene: Scene, asked: Scattering | None, *, layers: bool = True, matched: bool = True, volumes: bool = True
) -> GivenBack:
    """Bodies that give back what they scatter many times, and how.

    Unless something is asked for, those in which little is scattered do not.

    Parameters
    ----------
    scene : Scene
    asked : Scattering, optional
    layers : bool
        Bodies can be shown as layers.
    matched : bool
        Bodies without an interface can give back light, too.
    volumes : bool
        Rays can gather it on their way through them; else it leaves through their surface.

    Raises
    ------
    InputError
        If what is asked for can be done for none of the bodies that scatter.
    """
    if asked is not None and not asked.gives_back:
        return GivenBack()
    wanted = Diffusion() if asked is None else asked
    bodies = {
        i: body
        for i, body in enumerate(scene.objects)
        if body.medium is not None
        and body.medium.scatters
        and not body.covers
        and (body.has_interface or matched)
        and (asked is not None or _is_deep(body, body.medium))
    }
    refused = {i: why for i, body in bodies.items() if (why := wanted.refusal(body)) is not None}
    if not volumes:
        refused |= {i: _NO_STEPS for i, body in bodies.items() if _is_cloud(body)}
    if asked is None and len(bodies) - len(refused) > MOST_DIFFUSED:
        many = f"light would diffuse in more than {MOST_DIFFUSED} bodies, which takes long"
        refused = dict.fromkeys(bodies, many) | refused
    layer = ScatteringLayer()
    layered = tuple(
        i for i, body in bodies.items() if layers and (i in refused or wanted == layer) and layer.refusal(body) is None
    )
    solved = [i for i in bodies if i not in refused] if isinstance(wanted, Diffusion) else []
    if asked is not None and bodies and not solved and not layered:
        i = next(iter(bodies))
        why = refused.get(i, "this renderer draws no layers")
        raise InputError(str(asked), f"{scene.objects[i].mesh.name!r}: {why}", "use SingleScattering()")
    if not isinstance(wanted, Diffusion):
        return GivenBack(layered=layered)
    fogs = _volumes(scene, solved, wanted) if volumes else ()
    return GivenBack(
        tuple(i for i in solved if i not in fogs),
        layered,
        fogs,
        wanted,
        tuple((i, why) for i, why in refused.items() if i in layered),
    )


def _volumes(scene: Scene, solved: list[int], wanted: Diffusion) -> tuple[int, ...]:
    """The bodies into whose rays light is scattered, as far as each can have winding numbers of its own."""
    varying = tuple(i for i in solved if _is_cloud(scene.objects[i]))
    even = tuple(i for i in solved if scene.objects[i].density is None and _is_volume(scene.objects[i], wanted))
    if not (fogs := tuple(sorted(varying + even))):
        return ()
    return fogs if len(medium_slots(shown(scene, GivenBack(volumes=fogs)))) <= MAX_SLOTS else varying


def _is_cloud(body: Object) -> bool:
    return body.density is not None and not body.has_interface


def _is_deep(body: Object, medium: Medium) -> bool:
    reduced = np.asarray(medium.scattering) * (1.0 - medium.anisotropy)
    densest = 1.0 if body.density is None else body.density.maximum
    return bool(reduced.max() * densest * body.mean_thickness > LEAST_DEPTH)


def _is_volume(body: Object, wanted: Diffusion) -> bool:
    """True if rays gather light in a body of one density: where they see more than a skin beneath all cells."""
    if body.has_interface:
        return False
    medium = _medium(body)
    reduced = np.asarray(medium.absorption) + np.asarray(medium.scattering) * (1.0 - medium.anisotropy)
    return float(reduced.max()) * wanted.cell_size(body) < MOST_CELL_DEPTH


_SHOWN: WeakKeyDictionary[Scene, dict[GivenBack, Scene]] = WeakKeyDictionary()


def shown(scene: Scene, back: GivenBack | None) -> Scene:
    """Scene whose media say what they give back; the scene itself if they give back nothing."""
    if not back:
        return scene
    known = _SHOWN.setdefault(scene, {})
    if back not in known:
        objects = list(scene.objects)
        for i in back.layered:
            objects[i] = replace(objects[i], medium=LayeredMedium.of(_medium(objects[i])))
        for i in back.volumes:
            objects[i] = replace(objects[i], medium=DiffusedVolume.of(_medium(objects[i])))
        for i in back.diffused:
            objects[i] = replace(objects[i], medium=DiffusedMedium.of(_medium(objects[i]), scene.source(objects[i])))
        known[back] = replace(scene, objects=objects)
    return known[back]


def _medium(body: Object) -> Medium:
    assert body.medium is not None
    return body.medium
