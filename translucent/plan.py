"""The planner: from a scene to the cheapest passes that are exact for it, each with its reason. Pure; needs no GPU."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from translucent.errors import InputError
from translucent.scene import Object, Scene
from translucent.thickness import BackFaceDepth, Method, SignedDepth, ThinLayer

#: An open mesh that was declared solid is drawn, where it is not closed, as a sheet of this share of its diagonal.
FALLBACK_SHEET = 0.01


@dataclass(frozen=True)
class PassSpec:
    """One pass of a plan.

    Attributes
    ----------
    name : str
        What the pass is called in `Frame.seconds`.
    reason : str
        Why the scene needs it.
    objects : tuple of int
        Indices into `Scene.objects` of what it draws; empty for a pass over pixels.
    geometry_passes : int
        How often it draws them.
    target : {"accumulated", "fallback"}
        Where its paths add up: the fallback is read where the other does not balance.
    """

    name: str
    reason: str
    objects: tuple[int, ...] = ()
    geometry_passes: int = 0
    target: Literal["accumulated", "fallback"] = "accumulated"


@dataclass(frozen=True)
class RenderPlan:
    """What runs and why.

    Attributes
    ----------
    method : Method
        How thickness is found.
    passes : tuple of PassSpec
        In order.
    spectral : bool
        The passes add up optical depth per channel, since media differ, and not only thickness.
    limits : tuple of str
        Where thickness and transmittance are not exact, and why; empty for an exact plan.
    unmodelled : tuple of str
        What the scene asks for and no pass renders.
    """

    method: Method
    passes: tuple[PassSpec, ...]
    spectral: bool = False
    limits: tuple[str, ...] = ()
    unmodelled: tuple[str, ...] = ()

    @property
    def exact(self) -> bool:
        """Whether thickness and transmittance are exact for the meshes as given and straight rays, up to float32."""
        return not self.limits

    @property
    def geometry_passes(self) -> int:
        """How often geometry is drawn in all."""
        return sum(step.geometry_passes for step in self.passes)

    def summary(self) -> dict[str, object]:
        """The plan in values that JSON can hold."""
        return {
            "method": str(self.method),
            "exact": self.exact,
            "passes": [
                {"name": step.name, "reason": step.reason, "geometry_passes": step.geometry_passes}
                for step in self.passes
            ],
            "limits": list(self.limits),
            "unmodelled": list(self.unmodelled),
        }

    def __str__(self) -> str:
        lines = [f"{self.method}: {'exact' if self.exact else 'not exact everywhere'}"]
        lines += [f"  {i}. {step.name}: {step.reason}" for i, step in enumerate(self.passes, 1)]
        lines += [f"  limit: {limit}" for limit in self.limits]
        lines += [f"  not modelled: {effect}" for effect in self.unmodelled]
        return "\n".join(lines)


def plan(scene: Scene, method: Method | None = None) -> RenderPlan:
    """Choose the passes for a scene.

    Parameters
    ----------
    scene : Scene
    method : Method, optional
        How to find thickness; None picks the cheapest way that is exact.

    Raises
    ------
    InputError
        If no available method can render the scene.
    """
    if method is not None and not isinstance(method, Method):
        raise InputError(f"method {method!r}", "not a thickness method", "give for example tl.SignedDepth()")
    _refuse_unsupported(scene)
    if isinstance(method, BackFaceDepth):
        return _plan_back_face_depth(scene, method)
    if isinstance(method, ThinLayer):
        return _plan_thin_layer(scene, method)
    sheets = _indices(scene, lambda body: body.sheet_thickness is not None)
    if method is None and len(sheets) == len(scene.objects):
        return _plan_thin_layer(scene, ThinLayer())
    return _plan_signed_depth(scene, method or SignedDepth())


def _plan_signed_depth(scene: Scene, method: SignedDepth) -> RenderPlan:
    solids = _indices(scene, lambda body: body.sheet_thickness is None)
    sheets = _indices(scene, lambda body: body.sheet_thickness is not None)
    open_bodies = _indices(scene, lambda body: body.sheet_thickness is None and not body.mesh.diagnosis.solid)
    spectral = _media_differ(scene)
    what = (
        "optical depth per channel, since media differ" if spectral else "thickness, since all bodies share one medium"
    )
    passes = []
    limits = []
    if solids:
        reason = f"{_count(solids, 'body', 'bodies')} in one unsorted draw each: exits minus entries add up to {what}"
        passes.append(PassSpec("signed_depth", reason, solids, 1))
    if sheets:
        passes.append(
            _sheet_pass(sheets, f"{_count(sheets, 'mesh', 'meshes')} declared thin: paths through faces add up")
        )
    if open_bodies:
        passes += _fallback_passes(scene, solids, sheets, open_bodies)
        limits += [_open_limit(scene.objects[i]) for i in open_bodies]
    if not method.anchored:
        limits.append("distances count from the camera: float32 loses digits with distance")
    return _finished(scene, method, passes, limits, spectral)


def _fallback_passes(
    scene: Scene, solids: tuple[int, ...], sheets: tuple[int, ...], open_bodies: tuple[int, ...]
) -> list[PassSpec]:
    """What a pixel shows that enters and leaves unequally often: open bodies as sheets, all others as ever."""
    names = ", ".join(repr(scene.objects[i].mesh.name) for i in open_bodies)
    reason = (
        f"{names} not closed: pixels that enter and leave unequally often get sheets of {FALLBACK_SHEET:.0%} of the "
        "diagonal, and are marked invalid"
    )
    passes = [PassSpec("thin_layer_fallback", reason, open_bodies + sheets, 1, "fallback")]
    if closed := tuple(i for i in solids if i not in open_bodies):
        passes.append(PassSpec("signed_depth_fallback", "closed bodies, in those pixels, too", closed, 1, "fallback"))
    return passes


def _open_limit(body: Object) -> str:
    return (
        f"{body.mesh.name!r}: {'; '.join(body.mesh.diagnosis.problems)}: close it, or declare it a sheet "
        "(sheet_thickness=..., --method thin-layer)"
    )


def _plan_back_face_depth(scene: Scene, method: BackFaceDepth) -> RenderPlan:
    if _media_differ(scene):
        raise InputError("BackFaceDepth", "bodies with different media", "use SignedDepth, which tells them apart")
    if sheets := [body.mesh.name for body in scene.objects if body.sheet_thickness is not None]:
        raise InputError(
            "BackFaceDepth", f"{', '.join(map(repr, sheets))} declared a sheet", "use SignedDepth or ThinLayer"
        )
    everything = tuple(range(len(scene.objects)))
    passes = [PassSpec("back_face_depth", "asked for: nearest front face, then farthest back face", everything, 2)]
    limits = []
    if len(scene.objects) > 1:
        limits.append("several bodies: pixels that cross more than one are marked invalid")
    if concave := [body.mesh.name for body in scene.objects if not body.mesh.diagnosis.convex]:
        limits.append(f"{', '.join(concave)} not convex: pixels with more than one entry are marked invalid")
    return _finished(scene, method, passes, limits, spectral=False)


def _plan_thin_layer(scene: Scene, method: ThinLayer) -> RenderPlan:
    everything = tuple(range(len(scene.objects)))
    solid = [body.mesh.name for body in scene.objects if body.sheet_thickness is None and body.mesh.diagnosis.solid]
    limits = [f"{', '.join(map(repr, solid))} closed, but drawn as sheets: what is inside is left out"] if solid else []
    reason = f"every face of {_count(everything, 'mesh', 'meshes')} is a sheet: their paths add up"
    return _finished(scene, method, [_sheet_pass(everything, reason)], limits, _media_differ(scene))


def _sheet_pass(objects: tuple[int, ...], reason: str) -> PassSpec:
    return PassSpec("thin_layer", f"{reason}, t / max(0.001, n.v) each", objects, 1)


def _finished(scene: Scene, method: Method, passes: list[PassSpec], limits: list[str], spectral: bool) -> RenderPlan:
    """The plan with its last pass, and with the limits that any method has in this scene."""
    media = [body.medium for body in scene.bodies if body.medium is not None]
    if any(medium.emits for medium in media):
        reason = "Beer-Lambert, and the emission of the one medium in closed form, q / sigma_t (1 - T)"
    else:
        reason = "Beer-Lambert: the background through exp(-optical depth)"
    passes.append(PassSpec("transmittance", reason))
    for body in scene.bodies:
        if found := body.mesh.diagnosis.duplicate_faces:
            limits.append(f"{body.mesh.name!r}: {found.count} duplicated faces, which count twice or cancel")
    for body in scene.bodies:
        if parts := body.mesh.diagnosis.inside_out_parts:
            limits.append(f"{body.mesh.name!r}: {parts} closed parts inside out: their pixels are marked invalid")
    if scene.overlap != "add" and any(not body.mesh.diagnosis.convex for body in scene.bodies):
        limits.append(f'overlap="{scene.overlap}": where a mesh overlaps itself, its medium counts twice')
    unmodelled = []
    if any(medium.scatters for medium in media):
        unmodelled.append("in-scattered light: scattering only removes light")
    if any(medium.ior > 1 for medium in media):
        unmodelled.append("refraction and reflection: rays go straight, though ior is above 1")
    return RenderPlan(method, tuple(passes), spectral, tuple(limits), tuple(unmodelled))


def _refuse_unsupported(scene: Scene) -> None:
    if opaque := [body.mesh.name for body in scene.objects if body.medium is None]:
        raise InputError(
            f"rendering {', '.join(map(repr, opaque))}",
            "opaque objects are not supported yet",
            "give each object a medium",
        )
    if _media_differ(scene) and any(body.medium is not None and body.medium.emits for body in scene.bodies):
        raise InputError(
            "rendering emission among several media",
            "their order along the ray matters, and ordered intervals are not supported yet",
            "use one medium, or no emission",
        )
    if scene.overlap != "add" and (pair := _touching_pair(scene)) is not None:
        names = " and ".join(repr(scene.objects[i].mesh.name) for i in pair)
        raise InputError(
            f'overlap="{scene.overlap}"',
            f"{names} may overlap, which needs ordered intervals, and these are not supported yet",
            'use overlap="add", or move the bodies apart',
        )


def _touching_pair(scene: Scene) -> tuple[int, int] | None:
    """Two bodies whose bounds share a point, if there are any."""
    for j, later in enumerate(scene.objects):
        for i, earlier in enumerate(scene.objects[:j]):
            if (later.bounds[0] <= earlier.bounds[1]).all() and (later.bounds[1] >= earlier.bounds[0]).all():
                return i, j
    return None


def _media_differ(scene: Scene) -> bool:
    media = [body.medium for body in scene.bodies]
    return any(
        not np.array_equal(a.extinction, b.extinction) or not np.array_equal(a.emission, b.emission)
        for a, b in itertools.pairwise(media)
        if a is not None and b is not None
    )


def _indices(scene: Scene, keep: Callable[[Object], bool]) -> tuple[int, ...]:
    return tuple(i for i, body in enumerate(scene.objects) if keep(body))


def _count(items: tuple[int, ...], one: str, many: str) -> str:
    return f"{len(items)} {one if len(items) == 1 else many}"
