"""Path tracing: random paths of light through media and interfaces, the picture without approximations but noise."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

from translucent.arguments import checked
from translucent.errors import InputError
from translucent.planning.bodies import has_more, indices, open_bodies, varies_at_hits
from translucent.planning.methods.base import Method, check_count, check_hits
from translucent.planning.passes import Note, NoteKind, PassName, PassSpec
from translucent.scene.lights import PositionalLight
from translucent.scene.scene import Object, Scene, object_names

#: Largest number of paths of each pixel.
MAX_PATHS = 1 << 20


@checked
@dataclass(frozen=True)
class PathTraced(Method):
    """Random paths of light: all scattering, all interfaces; the error falls with the square root of their number.

    The estimator of `translucent.reference.path_trace` on the GPU, in float32: Fresnel and Snell by chance at
    interfaces, walks among the microfacets of rough ones (Heitz et al. 2016), free flights in media that scatter, with
    the balance heuristic over the channels (Wilkie et al. 2014). It takes the place of `interfaces` and `scattering`,
    which choose approximations. `Frame.standard_error` is the noise; thickness, optical depth and transmittance are
    those of the planner's own choice of method, and exact. Opaque objects are part of it: paths go on from them, so
    that grounds and bodies light each other.

    Light of point, spot and directional lights that polished interfaces bend is found by no path; sphere lights have
    a size that paths hit.

    Parameters
    ----------
    paths : int
        Of each pixel, from 2 to 2^20.
    seed : int
        Of the random numbers, 0 to 2^32 - 1.
    hits : {"embree", "gl"}, optional
        What finds the surfaces that paths hit: Embree on the processors, or shaders. None lets the planner pick: Embree
        where OpenGL draws on the processors, too, and no medium scatters, else shaders. The picture is the same.

    Raises
    ------
    InputError
        If a value is not one of these.
    """

    name: ClassVar[str] = "path-traced"
    cost: ClassVar[float] = 40.0  # of each path
    follows_paths: ClassVar[bool] = True

    paths: int = 64
    seed: int = 0
    hits: str | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        check_hits("PathTraced", self.hits)
        check_count("PathTraced paths", self.paths, MAX_PATHS, least=2, example=64)
        if not isinstance(self.seed, int) or isinstance(self.seed, bool) or not 0 <= self.seed < 1 << 32:
            raise InputError(
                f"PathTraced seed {self.seed!r}",
                "the seed must be a whole number in 0 to 2^32 - 1",
                "use a value such as 0",
            )

    def with_paths(self, paths: int) -> PathTraced:
        """The method with so many paths of each pixel."""
        return replace(self, paths=paths)

    def check(self, scene: Scene) -> None:
        """Refuse open bodies, layers, densities that vary, and sheets that scatter or are rough."""
        if scene.scatters_ambient:
            found = "ambient radiance stands for light that random paths find themselves"
            raise InputError("PathTraced with ambient radiance", found, "omit the ambient radiance")
        for bodies, found, do in _refusals(scene):
            if bodies:
                raise InputError(f"PathTraced of {object_names(bodies)}", found, do)

    def passes(self, scene: Scene, why: str) -> tuple[PassSpec, ...]:
        """The pass that follows the paths; the planner adds passes that find thickness."""
        reason = f"{why}: {self.paths} random paths for each pixel, scattered, reflected and refracted without limit"
        bodies = indices(scene, lambda body: body.medium is not None)
        return (PassSpec(PassName.PATH_TRACE, reason, bodies, cost=self.cost * self.paths),)

    def limits(self, scene: Scene) -> list[Note]:
        """Note that radiance has noise."""
        text = f"radiance is the mean of {self.paths} random paths; frame.standard_error states its noise"
        return [Note(NoteKind.NOISE, text)]

    def unmodelled(self, scene: Scene) -> tuple[Note, ...]:
        """Notes on effects that paths do not find or do not render."""
        notes = []
        bending = [body for body in scene.bodies if _bends(body)]
        # `plan` has points in place of spheres, each a part of one.
        if any(not isinstance(light, PositionalLight) or light.disc[3] == 0.0 for light in scene.lights) and bending:
            text = (
                "caustics and refracted light of point, spot and directional lights are missing, because no random "
                "path hits a light without a size; use tl.SphereLight"
            )
            notes.append(Note(NoteKind.LIGHTS_LEFT_OUT, text))
        surfaces = [(body, body.surface) for body in scene.bodies if body.surface is not None]
        if dispersive := [body for body, surface in surfaces if surface.dispersion > 0.0]:
            text = f"{object_names(dispersive)}: no dispersion; all colors are refracted alike"
            notes.append(Note(NoteKind.REFRACTION, text))
        if rough := [body for body, one in surfaces if one.clearcoat > 0.0 and one.clearcoat_roughness > 0.0]:
            text = f"{object_names(rough)}: rough clear coats are rendered as polished"
            notes.append(Note(NoteKind.COATS, text))
        if emitting := [body for body, surface in surfaces if surface.glows]:
            notes.append(Note(NoteKind.GLOW, f"{object_names(emitting)}: light that these surfaces emit is missing"))
        return tuple(notes)


def takes_picture(scene: Scene, *, textured: bool) -> bool:
    """True if paths that hit some opaque object first take its picture, since rays do not read all of its textures.

    `textured`: rays read textures at all.
    """
    return any(has_more(item) or (varies_at_hits(item) and not textured) for item in scene.opaque)


def has_bases(scene: Scene) -> bool:
    """True if interfaces of bodies have diffuse bases."""
    surfaces = [body.surface for body in scene.bodies if body.surface is not None]
    return any(surface.transmission < 1.0 or surface.transmission_texture is not None for surface in surfaces)


def _bends(body: Object) -> bool:
    """True if it has a polished interface that refracts light."""
    polished = body.surface is None or body.surface.roughness == 0.0
    return body.has_interface and body.medium is not None and body.medium.ior != 1.0 and polished


def _refusals(scene: Scene) -> tuple[tuple[list[Object], str, str], ...]:
    """Bodies that cannot be path traced, with reason and advice."""
    sheets = [body for body in scene.bodies if body.sheet_thickness is not None]
    return (
        (
            [scene.objects[i] for i in open_bodies(scene)],
            "not closed, so a path cannot tell which medium it is in",
            "close it, or declare it a sheet (sheet_thickness=...)",
        ),
        (
            [body for body in scene.bodies if body.density is not None],
            "the density varies, and distances between scattering events are drawn for constant density",
            "use tl.reference.path_trace(scene, size)",
        ),
        (
            [body for body in scene.bodies if body.covers],
            "partly transparent layers are drawn over the picture, not traced",
            "leave them out, or use another method",
        ),
        (
            [body for body in sheets if body.medium is not None and body.medium.scatters],
            "path tracing does not support sheets that scatter",
            "use a closed body instead, or use another method",
        ),
        (
            [body for body in sheets if body.surface is not None and body.surface.roughness > 0.0],
            "path tracing does not support rough sheets",
            "use tl.reference.path_trace(scene, size)",
        ),
    )
