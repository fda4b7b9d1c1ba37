"""Scenes: objects, a camera, lights and an environment; checks of their values and of overlapping bodies."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import InitVar, dataclass, field
from functools import cached_property
from importlib import import_module
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked, vectors
from translucent.arrays import Array, Frozen, Mask
from translucent.errors import InputError
from translucent.geometry.mesh import MAX_COORDINATE, Mesh, surface_area
from translucent.media.colors import ColorLike, reflectance
from translucent.media.density import Density
from translucent.media.medium import MAX_EMISSION, Medium
from translucent.media.preset import Preset
from translucent.media.presets import preset
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment, parse_radiance
from translucent.scene.lights import Light as Light
from translucent.scene.patterns import patterned, uniform_scale
from translucent.scene.surface import Surface

Overlap = Literal["add", "union", "priority"]

#: Default reflectance of opaque objects: a light gray, as of clay.
OPAQUE_COLOR = (0.6, 0.6, 0.6)

#: Largest number of names that a message lists.
MOST_NAMES = 8

#: Largest number of directions in which things throw shadows of an environment.
MOST_ENVIRONMENT_SHADOWS = 256


@checked
@dataclass(frozen=True, eq=False)
class Object(Frozen):
    """Object of a scene: a mesh filled with a medium, or opaque.

    Parameters
    ----------
    mesh : Mesh
        Bounds the body; its coordinates must be finite.
    medium : Medium or None
        What fills it; None makes the object opaque.
    transform : array_like (4, 4), optional
        Object to world, affine, for column vectors; may mirror and scale each axis, not flatten. Default: none.
    priority : int
        With ``overlap="priority"`` the higher one displaces the lower.
    sheet_thickness : float, optional
        Declares the mesh a thin sheet of this thickness in metres, not the boundary of a solid.
    color : str or array_like (3,)
        What an opaque object without a surface diffusely reflects, 0 to 1: a color as text, or linear RGB.
    density : DensityGrid, LinearDensity or ExponentialDensity, optional
        Scales absorption, scattering and emission of the medium from place to place, over the bounds of the mesh in
        object space. Default: homogeneous.
    surface : Surface, optional
        What the interface does to light. Default: polished, and nothing to be seen of it if the medium's ior is 1; an
        opaque object reflects diffusely.
    shadow_catcher : bool
        Whether an opaque object is a ground for the others, of any size. Rendered with ``transparent``, no more is
        seen of it than the shadows on it, over what the frame is put over.
    material : Preset or str, optional
        A preset, or its name, for medium and surface together: ``tl.Object(mesh, material="wax")``. With a pattern,
        as marble has, the object has the mesh with texture coordinates of that.
    """

    mesh: Mesh
    medium: Medium | None = None
    transform: npt.ArrayLike | None = None
    priority: int = 0
    sheet_thickness: float | None = None
    color: ColorLike = OPAQUE_COLOR
    density: Density | None = None
    surface: Surface | None = None
    shadow_catcher: bool = False
    material: InitVar[Preset | str | None] = field(default=None, kw_only=True)

    def __post_init__(self, material: Any) -> None:
        if material is not None:
            self._make_of(material)
        _require_type("mesh of an object", self.mesh, Mesh, "use tl.load_mesh or tl.Mesh")
        if self.medium is not None:
            _require_type("medium of an object", self.medium, Medium, "use tl.Medium")
        self.mesh.require_finite()
        matrix = np.eye(4) if self.transform is None else np.array(self.transform, dtype=np.float64)
        where = f"transform of {self.mesh.name!r}"
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            raise InputError(
                where, "the transform must be a finite 4x4 matrix", "give a 4x4 matrix that multiplies column vectors"
            )
        if not np.array_equal(matrix[3], (0, 0, 0, 1)):
            raise InputError(
                where,
                f"the last row of the transform is {tuple(matrix[3].tolist())}",
                "use an affine matrix with the last row 0 0 0 1",
            )
        if np.linalg.matrix_rank(matrix[:3, :3]) < 3:
            raise InputError(
                where, "the transform flattens the mesh (a scale of 0)", "use a scale other than 0 along every axis"
            )
        matrix.setflags(write=False)
        object.__setattr__(self, "transform", matrix)
        if (largest := float(np.abs(self.bounds).max())) > MAX_COORDINATE:
            raise InputError(
                where,
                f"the transform moves the mesh {largest:.3g} m away from the origin",
                f"keep all points within {MAX_COORDINATE:g} m",
            )
        _require_type("priority of an object", self.priority, (int, float, np.number), "give a whole number, such as 1")
        if self.sheet_thickness is not None and not 0 < self.sheet_thickness <= MAX_COORDINATE:
            raise InputError(
                f"sheet_thickness {self.sheet_thickness} of {self.mesh.name!r}",
                "the thickness must be above 0",
                "give the thickness in metres, for example 1e-3",
            )
        object.__setattr__(self, "color", reflectance(self.color, self.mesh.name))
        if self.density is not None:
            _require_type("density of an object", self.density, get_args(Density), "use for example tl.DensityGrid")
            if self.medium is None or self.sheet_thickness is not None:
                what = "opaque" if self.medium is None else "a thin-walled sheet without an inside"
                raise InputError(
                    f"density of {self.mesh.name!r}",
                    f"the object is {what}",
                    "give the object a medium to fill, or no density",
                )
        if self.shadow_catcher and self.medium is not None:
            raise InputError(
                f"shadow_catcher {self.mesh.name!r}",
                "a medium fills the object, but a shadow catcher must be opaque",
                "remove the medium of the object",
            )
        if self.surface is not None:
            self._check_surface(self.surface)

    def _make_of(self, material: Any) -> None:
        """Take medium and surface of a preset."""
        requested = f"material of {self.mesh.name!r}"
        if self.medium is not None or self.surface is not None:
            found = f"a {'medium' if self.medium is not None else 'surface'} is given, too"
            raise InputError(requested, found, "give either the material, or the medium and the surface")
        if not isinstance(material, Preset | str):
            do = 'give a preset or its name, such as "wax"; for a color, use tl.showcase(mesh, color, distance)'
            raise InputError(requested, f"of type {type(material).__name__}", do)
        made = preset(material) if isinstance(material, str) else material
        object.__setattr__(self, "medium", made.medium)
        scale = 1.0 if self.transform is None else uniform_scale(self.transform)
        surface = Surface(roughness=made.roughness) if made.roughness else None
        mesh, surface = patterned(self.mesh, surface, made.pattern, scale)
        object.__setattr__(self, "mesh", mesh)
        object.__setattr__(self, "surface", surface)

    def _check_surface(self, surface: Surface) -> None:
        _require_type("surface of an object", surface, Surface, "use tl.Surface")
        if self.mesh.uv is None and any(surface.textures):
            raise InputError(
                f"surface of {self.mesh.name!r}",
                "the surface has textures, but the mesh has no texture coordinates",
                "unwrap the mesh",
            )
        if surface.opacity is not None and (self.medium is None or self.sheet_thickness is None):
            what = "opaque" if self.medium is None else "a solid"
            do = "give the object a clear medium and a sheet_thickness, or no opacity"
            raise InputError(
                f"opacity of {self.mesh.name!r}",
                f"the object is {what}, and only thin-walled sheets can have an opacity",
                do,
            )

    def __repr__(self) -> str:
        return f"Object({self.mesh!r}, {self.medium!r})"

    @property
    def base_color(self) -> Array:
        """(3,): diffuse reflectance of an opaque object: the color of its surface, if it has one."""
        return np.asarray(self.color if self.surface is None else self.surface.color)

    @cached_property
    def has_interface(self) -> bool:
        """True if its interface changes light: refracts, reflects, tints or scatters it."""
        if self.medium is None or self.covers:
            return False
        return self.medium.ior != 1.0 or not self.plain

    def to_unit_box(self, center: Array) -> Array:
        """(3, 4): from points of the world, given from `center` (3,) in metres, to the box of a `Density`; float64."""
        low, high = self.mesh.bounds
        extent = high - low
        # All of a flat mesh is in the middle of its box.
        scale = np.where(extent > 0, 1.0 / np.where(extent > 0, extent, 1.0), 0.0)
        linear = scale[:, None] * np.linalg.inv(self.matrix[:3, :3])
        middle = self.matrix[:3, :3] @ (0.5 * (low + high)) + self.matrix[:3, 3]
        return np.column_stack([linear, 0.5 + linear @ (center - middle)])

    @property
    def world_vertices(self) -> Array:
        """(n, 3): vertices of the mesh in the world, in metres."""
        return np.asarray(self.mesh.vertices @ self.matrix[:3, :3].T + self.matrix[:3, 3])

    @cached_property
    def mean_thickness(self) -> float:
        """Twice the volume over the area, in metres: of a wide slab its thickness, of a ball two thirds of the radius.

        Of a sheet, its thickness; of what is not closed, a quarter of the diagonal.
        """
        if self.sheet_thickness is not None:
            return self.sheet_thickness
        if not self.mesh.diagnosis.sound:
            return 0.25 * float(np.linalg.norm(self.bounds[1] - self.bounds[0]))
        return 2.0 * abs(self.mesh.volume * float(np.linalg.det(self.matrix[:3, :3]))) / self.area

    @cached_property
    def area(self) -> float:
        """Area of the surface in square metres."""
        linear = self.matrix[:3, :3]
        squared = linear.T @ linear
        if np.allclose(squared, squared[0, 0] * np.eye(3), rtol=0.0, atol=1e-12 * squared[0, 0]):
            return self.mesh.area * float(squared[0, 0])
        return surface_area(self.mesh.vertices @ linear.T, self.mesh.faces)

    @property
    def has_holes(self) -> bool:
        """True if the object is a thin sheet in which alpha may make holes."""
        return (
            self.sheet_thickness is not None
            and self.surface is not None
            and (self.covers or self.surface.alpha_cutoff > 0)
            and (self.surface.color_texture is not None or self.mesh.colors is not None)
        )

    @property
    def covers(self) -> bool:
        """True if the object is a partly transparent layer; see `Surface.opacity`."""
        return self.surface is not None and self.surface.opacity is not None

    @property
    def plain(self) -> bool:
        """True if neither its surface nor its vertex colors change light that passes."""
        return self.surface is None or (self.surface.plain and self.mesh.colors is None)

    @property
    def matrix(self) -> Array:
        """(4, 4): object to world."""
        return np.asarray(self.transform)

    @cached_property
    def mirrored(self) -> bool:
        """True if the transform reverses the winding."""
        return bool(np.linalg.det(self.matrix[:3, :3]) < 0)

    @cached_property
    def faces_inwards(self) -> bool:
        """True if the faces, as drawn, face into the body: mirrored, or inverted, but not both."""
        return self.mirrored != self.mesh.diagnosis.inverted

    @cached_property
    def bounds(self) -> Array:
        """(2, 3): smallest and largest world coordinates."""
        low, high = self.mesh.bounds
        corners = np.array([[(low, high)[i >> axis & 1][axis] for axis in range(3)] for i in range(8)])
        world = corners @ self.matrix[:3, :3].T + self.matrix[:3, 3]
        return np.stack([world.min(axis=0), world.max(axis=0)])

    @cached_property
    def radius(self) -> float:
        """Radius of a ball around the center of the bounds that holds the object."""
        return float(np.linalg.norm(self.matrix[:3, :3], ord=2)) * self.mesh.radius

    @checked
    def open_from(self, camera: Camera) -> float:
        """Metres ahead of the eye, along the camera's axis, from which on the surface may be open; inf for a solid.

        Before that all rays enter as often as they leave, up to what they are in. From within its bounds an open body
        may be open anywhere.
        """
        if (found := self.mesh.diagnosis.open_bounds) is None:
            return np.inf
        if camera.fov_y is not None and (self.bounds[0] <= camera.eye).all() and (self.bounds[1] >= camera.eye).all():
            return -np.inf
        corners = np.array([[found[i >> axis & 1][axis] for axis in range(3)] for i in range(8)])
        return float(((corners @ self.matrix[:3, :3].T + (self.matrix[:3, 3] - camera.eye)) @ camera.forward).min())

    @checked
    def winding_number(self, point: npt.ArrayLike) -> float:
        """Winding number around a world-space point: 0 or 1 for a simple solid; quick outside the bounds."""
        local = np.linalg.solve(self.matrix[:3, :3], vectors("point", point) - self.matrix[:3, 3])
        if (local < self.mesh.bounds[0]).any() or (local > self.mesh.bounds[1]).any():
            return 0.0
        number = self.mesh.winding_number(local)
        return -number if self.mesh.diagnosis.inverted else number


@checked
@dataclass(frozen=True, eq=False)
class Scene(Frozen):
    """Scene: the objects, camera, lights and environment of a picture.

    Parameters
    ----------
    objects : sequence of Object
        At least one.
    camera : Camera
    lights : sequence of PointLight, SpotLight, DirectionalLight or another light
    environment : Environment
        Default: white from everywhere.
    overlap : {"add", "union", "priority"}
        What fills a place that several bodies claim. ``add``: the mixture of all, and thickness counts each of them.
        ``union``: each medium once, however many bodies bring it. ``priority``: the medium of the highest priority.
        With the last two, thickness counts a place once.
    ambient : str or array_like (3,)
        Radiance that reaches every place inside the media alike from all around, as if nothing were in its path: a
        color as text, or linear RGB. Media scatter it into the view rays, sigma_s times ambient for each metre,
        whatever their phase function. It approximates light that has been scattered often, or comes from the
        environment, which by itself lights opaque objects only. Default: none.
    environment_shadows : int
        Directions of the environment, 0 to 256, in which objects keep its light from opaque ones: the more, the
        smoother the shadows; 32 are good to a few percent. 0: it reaches them through everything, but a flat ground
        still has the shadows of bodies in which light diffuses.
    """

    objects: Sequence[Object]
    camera: Camera
    lights: Sequence[Light] = ()
    environment: Environment = field(default_factory=lambda: Environment.constant((1.0, 1.0, 1.0)))
    overlap: Overlap = "add"
    ambient: ColorLike = (0.0, 0.0, 0.0)
    environment_shadows: int = 0

    def __post_init__(self) -> None:
        for field_name, kinds in (("objects", Object), ("lights", get_args(Light))):
            given = getattr(self, field_name)
            items = tuple(given) if isinstance(given, Iterable) else (given,)
            for item in items:
                _require_type(f"{field_name} of a scene", item, kinds, "give a list of them")
            object.__setattr__(self, field_name, items)
        _require_type("camera of a scene", self.camera, Camera, "use tl.Camera.look_at")
        _require_type("environment of a scene", self.environment, Environment, "use tl.Environment.constant")
        if not self.objects:
            raise InputError("scene", "the scene has no objects", "add at least one tl.Object")
        if self.overlap not in get_args(Overlap):
            raise InputError(
                f"overlap {self.overlap!r}",
                "no overlap rule has this name",
                f"use one of {', '.join(get_args(Overlap))}",
            )
        if (
            isinstance(self.environment_shadows, bool)
            or not isinstance(self.environment_shadows, int)
            or not 0 <= self.environment_shadows <= MOST_ENVIRONMENT_SHADOWS
        ):
            raise InputError(
                f"environment_shadows {self.environment_shadows!r}",
                f"the number of directions must be a whole number in 0 to {MOST_ENVIRONMENT_SHADOWS}",
                "use a value such as 32, or 0 for no shadows",
            )
        object.__setattr__(self, "ambient", parse_radiance("ambient radiance", self.ambient))
        for body in self.bodies:
            if not (self.source(body) <= MAX_EMISSION).all():
                raise InputError(
                    f"ambient radiance in {body.mesh.name!r}",
                    f"the medium would scatter more than {MAX_EMISSION:g} of this radiance per metre",
                    "check the unit of the scattering coefficient",
                )

    def __repr__(self) -> str:
        return f"Scene of {len(self.objects)} objects, {len(self.lights)} lights, {self.environment.kind} environment"

    def _repr_mimebundle_(self, **_: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        """A small picture and what is in the scene, for notebooks."""
        # By name: a scene is a value, and knows of no renderer.
        found: tuple[dict[str, Any], dict[str, Any]] = import_module("translucent.notebook.view").scene_bundle(self)
        return found

    def _repr_html_(self) -> str:
        """HTML of the scene for notebooks without rich bundles."""
        return str(self._repr_mimebundle_()[0]["text/html"])

    @cached_property
    def bodies(self) -> tuple[Object, ...]:
        """Objects that are filled with a medium."""
        return tuple(body for body in self.objects if body.medium is not None)

    @cached_property
    def opaque(self) -> tuple[Object, ...]:
        """Objects without a medium, which are opaque."""
        return tuple(item for item in self.objects if item.medium is None)

    @cached_property
    def boxes(self) -> Array:
        """(objects, 2, 3): smallest and largest world coordinates of each object."""
        return np.array([body.bounds for body in self.objects])

    @cached_property
    def radii(self) -> Array:
        """(objects,): radius of a ball around the center of each object's box that holds it."""
        return np.array([body.radius for body in self.objects])

    @cached_property
    def filled(self) -> Mask:
        """(objects,): whether a medium fills it."""
        return np.array([body.medium is not None for body in self.objects])

    @cached_property
    def bounds(self) -> Array:
        """(2, 3): smallest and largest world coordinates of all objects."""
        return np.stack([self.boxes[:, 0].min(axis=0), self.boxes[:, 1].max(axis=0)])

    @checked
    def source(self, body: Object) -> Array:
        """(3,): radiance per metre that a body's medium adds to all rays: q + sigma_s A, with the ambient radiance A.

        Phase functions integrate to 1, so none of them matters.
        """
        if body.medium is None:
            return np.zeros(3)
        with np.errstate(over="ignore", under="ignore"):
            scattered = np.asarray(body.medium.scattering) * np.asarray(self.ambient)
            return np.asarray(body.medium.emission + scattered, dtype=np.float64)

    @cached_property
    def varies(self) -> bool:
        """True if the density of any body varies in space."""
        return any(body.density is not None for body in self.bodies)

    @cached_property
    def scatters_ambient(self) -> bool:
        """True if any medium scatters ambient radiance."""
        media = [body.medium for body in self.bodies if body.medium is not None]
        return any(bool((np.asarray(medium.scattering) * np.asarray(self.ambient) > 0).any()) for medium in media)

    @cached_property
    def shown(self) -> tuple[Object, ...]:
        """Objects of the picture, without shadow catchers, unless there are no others."""
        return tuple(item for item in self.objects if not item.shadow_catcher) or tuple(self.objects)

    @cached_property
    def shown_bounds(self) -> Array:
        """(2, 3): smallest and largest world coordinates of the visible objects."""
        rendered = ~np.array([item.shadow_catcher for item in self.objects])
        boxes = self.boxes[rendered] if rendered.any() else self.boxes
        return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])

    @cached_property
    def diagonal(self) -> float:
        """Diagonal of the visible objects in metres, which is the scale of the scene, whatever its ground."""
        return float(np.linalg.norm(self.shown_bounds[1] - self.shown_bounds[0]))


def object_names(items: Iterable[Object]) -> str:
    """Names of objects for messages: those of their meshes, each once, and only the first of many."""
    names = list(dict.fromkeys(repr(item.mesh.name) for item in items))
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES + 1 else ""
    return ", ".join(names[:MOST_NAMES] if more else names) + more


def _require_type(what: str, value: object, kinds: type | tuple[type, ...], do: str) -> None:
    if not isinstance(value, kinds):
        raise InputError(f"{what} {value!r}", f"of type {type(value).__name__}", do)


def check_scene(scene: object) -> None:
    """Raise `InputError` unless this is a scene."""
    if not isinstance(scene, Scene):
        kind = type(scene).__name__
        raise InputError("a scene", f"the object is a {kind}", "give a tl.Scene, for example tl.showcase(mesh, medium)")


Indices = npt.NDArray[np.intp]

#: Pairs that are compared at a time: few enough for the memory, and enough for NumPy to be quick.
MOST_PAIRS = 1 << 20


def first_overlap(
    boxes: Array, matters: Callable[[Indices, Indices], npt.NDArray[np.bool_]] | None = None
) -> tuple[int, int] | None:
    """Indices of two boxes that share volume, the earlier one first; None if there are none.

    Of few boxes, the pair whose later box comes first. The time grows as n log n and with the pairs that overlap along
    the axis where the fewest do.

    Parameters
    ----------
    boxes : (n, 2, 3) float64
        Smallest and largest coordinates.
    matters : callable, optional
        Gets the numbers of the boxes of many pairs, and says which of the pairs count. Default: all.
    """
    for one, other in _candidates(boxes):
        inside = (boxes[one, 0] < boxes[other, 1]).all(axis=1) & (boxes[one, 1] > boxes[other, 0]).all(axis=1)
        one, other = one[inside], other[inside]
        if matters is not None:
            counted = matters(one, other)
            one, other = one[counted], other[counted]
        if len(one):
            earlier, later = np.minimum(one, other), np.maximum(one, other)
            found = np.lexsort((earlier, later))[0]
            return int(earlier[found]), int(later[found])
    return None


def _candidates(boxes: Array) -> Iterator[tuple[Indices, Indices]]:
    """Pairs of boxes that overlap along the axis where the fewest do, a part at a time."""
    order, partners = min((_along(boxes[..., axis]) for axis in range(3)), key=lambda found: int(found[1].sum()))
    until = np.cumsum(partners)
    first = 0
    while first < len(order):
        done = int(until[first - 1]) if first else 0
        last = max(int(np.searchsorted(until, done + MOST_PAIRS, side="right")), first + 1)
        counts = partners[first:last]
        one = np.repeat(np.arange(first, last), counts)
        # The partners of a box come right after it in the order.
        other = one + 1 + np.arange(len(one)) - np.repeat(np.cumsum(counts) - counts, counts)
        yield order[one], order[other]
        first = last


def _along(ends: Array) -> tuple[Indices, Indices]:
    """Order in which boxes begin along an axis, and for each the number that begin later and before it ends."""
    order = np.argsort(ends[:, 0], kind="stable")
    begin, end = ends[order].T
    return order, np.maximum(np.searchsorted(begin, end, side="left") - np.arange(len(order)) - 1, 0)
