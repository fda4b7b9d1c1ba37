"""Grounds: flat objects, or planes of others, that reflect the objects on them, or catch their shadows and light."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface

#: Roughness above which a coat mirrors a blur and no more.
MOST_ROUGHNESS = 0.4

#: Largest distance of a ground's vertices from its plane, as a fraction of its size.
FLAT = 1e-6

#: Fraction of half of all directions in which faces of a solid are seen from the middle of a body, from which on they
#: are its ground. A statue of wax without an interface on a sunny white slab of 0.2 is 12 % too dark without the light
#: of that ground, and 1 % too bright with it; a ball with that light is up to 7 % off.
WIDE = 0.1

#: Fraction of the scene's size by which what stands on a flat ground may be below it, by rounding.
SUNK = 1e-5

#: Distance from its plane up to which a point is on a ground, as a fraction of the size of a map of its light.
TOLERANCE = 1e-3


class Mirror(NamedTuple):
    """Flat ground.

    Attributes
    ----------
    ground : Object
    normal : (3,)
        Unit vector to its outer side.
    height : float
        Of the ground along it, in metres from the world's origin.
    """

    ground: Object
    normal: Array
    height: float

    @property
    def matrix(self) -> Array:
        """(4, 4): reflection at the plane."""
        matrix = np.eye(4)
        matrix[:3, :3] -= 2.0 * np.outer(self.normal, self.normal)
        matrix[:3, 3] = 2.0 * self.height * self.normal
        return matrix

    @property
    def has_walls(self) -> bool:
        """True if parts of the object are above its ground."""
        return float((self.ground.world_vertices @ self.normal).max()) - self.height > SUNK * self.ground.radius


def mirror_of(scene: Scene) -> Mirror | None:
    """Flat surface of a scene that mirrors its objects, if it has one; its normal is towards the eye.

    The first flat shadow catcher with a smooth coat, else the first other opaque object with one, or of smooth metal.
    """
    for item in sorted(scene.opaque, key=lambda item: not item.shadow_catcher):
        if _is_smooth(item) and (found := _flat(item)) is not None:
            if item.shadow_catcher or _is_above(scene, found):
                return found
            return Mirror(item, -found.normal, -found.height)
    return None


def ground_of(scene: Scene) -> Mirror | None:
    """Ground of a scene, if it has one: the first flat shadow catcher that is opaque."""
    return next((found for item in scene.opaque if item.shadow_catcher and (found := _flat(item))), None)


def ground_below(scene: Scene, bodies: Sequence[int]) -> Mirror | None:
    """Opaque plane that is nearest to the undersides of bodies, whose middles are all above; None if there is none.

    It is a flat object below them, or faces of a solid, in which bodies may be sunk, that fill `WIDE` of what a body
    sees, such as the top of a table or the floor of a room. Its normal is towards the bodies.
    """
    standing = [scene.objects[i] for i in bodies]
    boxes = scene.boxes[list(bodies)]
    middles = boxes.mean(axis=1)
    best, found, sunk = np.inf, None, SUNK * scene.diagonal
    for item in scene.opaque:
        planes: Sequence[tuple[Mirror, Array | None]] = _planes(item, boxes)
        if (mirror := _flat(item)) is not None:
            planes = [(mirror, None), (Mirror(item, -mirror.normal, -mirror.height), None)]
        for plane, faces in planes:
            if (middles @ plane.normal < plane.height - sunk).any():
                continue
            lowest = min(_lowest(body, plane.normal) for body in standing) - plane.height
            if abs(lowest) < best and (lowest >= -sunk if faces is None else (_seen(faces, middles) >= WIDE).any()):
                best, found = abs(lowest), plane
    return found


def _lowest(body: Object, normal: Array) -> float:
    """Least coordinate of a body along a unit vector (3,); by its box, where that is as exact."""
    if np.abs(normal).max() > 1.0 - SUNK**2:
        return float(np.where(normal > 0, *body.bounds) @ normal)
    return float((body.mesh.vertices @ (body.matrix[:3, :3].T @ normal)).min() + body.matrix[:3, 3] @ normal)


def _planes(item: Object, boxes: Array) -> list[tuple[Mirror, Array]]:
    """Planes of faces of a solid, and corners (k, 3, 3) of these faces, seen from outside.

    Of a room around one of some boxes (b, 2, 3), and of a mesh with holes, both sides.
    """
    if not item.mesh.planes:
        return []
    corners, found = item.world_vertices, []
    around = boxes[((boxes[:, 0] >= item.bounds[0]) & (boxes[:, 1] <= item.bounds[1])).all(axis=1)]
    both = not item.mesh.diagnosis.solid or any(item.winding_number(one.mean(axis=0)) > 0.5 for one in around)
    for group in item.mesh.planes:
        faces = corners[item.mesh.faces[group]]
        normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]).sum(axis=0)
        normal *= (-1.0 if item.faces_inwards else 1.0) / np.linalg.norm(normal)
        height = float(faces.mean(axis=(0, 1)) @ normal)
        found += [(Mirror(item, side * normal, side * height), faces) for side in ((1.0, -1.0) if both else (1.0,))]
    return found


def _seen(faces: Array, points: Array) -> Array:
    """(p,): fraction of half of all directions in which points (p, 3) see faces (k, 3, 3) of one plane.

    Van Oosterom & Strackee 1983, "The solid angle of a plane triangle".
    """
    a, b, c = np.moveaxis(faces[None] - points[:, None, None], 2, 0)
    lengths = [np.linalg.norm(one, axis=-1) for one in (a, b, c)]
    box = np.einsum("pki,pki->pk", a, np.cross(b, c))
    dots = [np.einsum("pki,pki->pk", one, other) for one, other in ((b, c), (c, a), (a, b))]
    rest = np.prod(lengths, axis=0) + sum(length * dot for length, dot in zip(lengths, dots, strict=True))
    return np.asarray(np.abs(2.0 * np.arctan2(box, rest).sum(axis=1)) / (2.0 * np.pi))


def ground_from_above(scene: Scene) -> Mirror | None:
    """Ground of a scene that is viewed from above, and lit from there alone with one normal; None elsewhere."""
    if (ground := ground_of(scene)) is None:
        return None
    surface = ground.ground.surface
    if surface is not None and (surface.normal_texture is not None or surface.diffuse_transmission > 0):
        return None
    return ground if _is_above(scene, ground) else None


def _is_above(scene: Scene, ground: Mirror) -> bool:
    """Test whether a scene is viewed from the side of a ground that its normal points to."""
    camera = scene.camera
    if camera.fov_y is None:
        return float(camera.forward @ ground.normal) < 0.0
    return float(camera.eye @ ground.normal) > ground.height


def lit_side(scene: Scene) -> Array | None:
    """Normal of all that a scene shows of opaque surfaces, where that is the upper side of a ground; None elsewhere.

    Bodies stand on it, so that no ray sees it from below.
    """
    if len(scene.opaque) != 1 or (ground := ground_from_above(scene)) is None:
        return None
    low, high = scene.boxes[scene.filled][:, 0], scene.boxes[scene.filled][:, 1]
    lowest = np.where(ground.normal > 0, low, high) @ ground.normal - ground.height
    return ground.normal if (lowest >= -SUNK * scene.diagonal).all() else None


def _is_smooth(item: Object) -> bool:
    surface = item.surface
    if surface is None or (surface.metallic == 0.0 and surface.ior == 1.0):
        return False
    textured = surface.color_texture is not None or item.mesh.colors is not None
    even = not textured and surface.iridescence == 0.0 and surface.clearcoat == 0.0
    return (
        (surface.metallic == 0.0 or even)
        and surface.roughness <= MOST_ROUGHNESS
        and surface.roughness_texture is None
        and surface.normal_texture is None
    )


def _flat(item: Object) -> Mirror | None:
    """Plane of a flat object; None for others."""
    corners = item.world_vertices
    normal, thickness = _plane(item, corners)
    return None if thickness > FLAT else Mirror(item, normal, float(corners[item.mesh.faces[0, 0]] @ normal))


def _plane(item: Object, corners: Array) -> tuple[Array, float]:
    """Mean unit normal (3,) of an object on its outer side, and its extent along that as a fraction of its size."""
    faces = corners[item.mesh.faces]
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]).sum(axis=0)
    normal *= -1.0 if item.mirrored else 1.0
    if not (length := float(np.linalg.norm(normal))) > 0:
        return normal, np.inf
    away = faces - faces[0, 0]
    return normal / length, float(np.abs(away @ (normal / length)).max() / np.abs(away).max())


AnyScene = TypeVar("AnyScene", bound=Scene)


def page_radiance(scene: Scene) -> float:
    """Largest radiance, up to 1, that diffuse shadow catchers can show all over a scene.

    Raises
    ------
    InputError
        If light does not fall evenly on a shadow catcher, so that a shadow on it would look like that.
    """
    lit = [_irradiance(scene, item).min() / np.pi for item in scene.objects if item.shadow_catcher]
    return float(min(1.0, *lit)) if lit else 1.0


def before_page(scene: AnyScene, radiance: float) -> AnyScene:
    """Scene before a background of even radiance, which unshadowed parts of its shadow catchers match."""
    page = scene.environment.with_background(Environment.constant((radiance,) * 3))
    objects = [_painted(scene, item, radiance) if item.shadow_catcher else item for item in scene.objects]
    return dataclasses.replace(scene, environment=page, objects=objects)


def _painted(scene: Scene, item: Object, radiance: float) -> Object:
    color = np.clip(radiance * np.pi / _irradiance(scene, item), 0.0, 1.0)
    one_sided = item.surface is not None and not item.surface.double_sided
    return dataclasses.replace(item, surface=Surface(color=color, ior=1.0, roughness=1.0, double_sided=not one_sided))


def _irradiance(scene: Scene, item: Object) -> Array:
    """(3,): irradiance on the outer side of a shadow catcher that nothing shadows."""
    what = f"a transparent frame with the shadow catcher {item.mesh.name!r}"
    normal, thickness = _plane(item, item.mesh.vertices @ item.matrix[:3, :3].T)
    if not normal.any():
        raise InputError(what, "the mesh of the shadow catcher has no area", "use a flat mesh")
    if thickness > FLAT:
        raise InputError(
            what, "the mesh of the shadow catcher is not flat", "use a flat mesh, or render without transparency"
        )
    if any(not isinstance(light, DirectionalLight) for light in scene.lights):
        do = "use DirectionalLight, or render without transparency"
        raise InputError(what, "a light at a finite distance illuminates the shadow catcher unevenly", do)
    irradiance = scene.environment.irradiance_on(normal)
    for light in scene.lights:
        irradiance = irradiance + light.irradiance_on(np.zeros(3), normal)
    if not (irradiance > 0).all():
        raise InputError(
            what, "no light of one of the colors reaches the shadow catcher", "illuminate the shadow catcher from above"
        )
    return np.asarray(irradiance)
