"""Staging of a contender: its variant of the scene, its plan, and its frame, ready to be drawn."""

from __future__ import annotations

import dataclasses
from typing import cast

from translucent.bench.contenders import REFRACTED_IOR, Contender
from translucent.bench.drawing import Drawing, OfEngine, OnProcessor, Planned, Short, Studio
from translucent.errors import InputError
from translucent.gpu.passes.shortcuts import HalfFloatPass, NearestFace, NearestFacePass, Shortcut, UnmarkedBackFacePass
from translucent.gpu.targets import Targets
from translucent.planning.methods import BackFaceDepth, RayMarched, SignedDepth
from translucent.planning.render_plan import RenderPlan
from translucent.planning.scattering import SingleScattering
from translucent.renderer import Renderer
from translucent.scene.scene import Object, Scene


def seen_by(contender: Contender, scene: Scene) -> Scene:
    """Scene with the contender's index of refraction."""
    if contender.ior is None:
        return scene

    def bent(body: Object) -> Object:
        if body.medium is None:
            return body
        own = body.medium.ior if body.medium.ior > 1 else REFRACTED_IOR
        ior = 1.0 if contender.ior == "matched" else own
        surface = None if contender.ior == "matched" else body.surface
        return dataclasses.replace(body, medium=dataclasses.replace(body.medium, ior=ior), surface=surface)

    return dataclasses.replace(scene, objects=[bent(body) for body in scene.objects])


def drawing(
    studio: Studio,
    contender: Contender,
    scene: Scene,
    plan: RenderPlan,
    targets: Targets,
    size: float,
    cpu: Renderer | None,
) -> Drawing:
    """Drawing of a contender, ready to be drawn; `size` is the thickness that a shortcut assumes, in metres."""
    if contender.technique in ("cpu", "march"):
        assert cpu is not None, "there is a plan for it"
        # What the reference marches by is `RayMarched`, as it checks.
        march = cast("RayMarched", contender.method) if contender.technique == "march" else None
        return OnProcessor(studio, cpu, scene, targets.size, march)
    if contender.engine is not None:
        return OfEngine(studio, scene, targets.size, contender.engine)
    if contender.technique == "plan":
        return Planned(studio, scene, targets, plan)
    shortcut: Shortcut
    if contender.technique == "half":
        shortcut = studio.own(HalfFloatPass)
    elif contender.technique == "unmarked":
        shortcut = studio.own(UnmarkedBackFacePass)
    else:
        shortcut = NearestFace(studio.own(NearestFacePass), sphere=contender.technique == "ball", size=size)
    return Short(studio, scene, targets, plan, shortcut)


def plan_of(studio: Studio, contender: Contender, scene: Scene, cpu: Renderer | None = None) -> RenderPlan:
    """Plan of a contender, or the one that shades a shortcut; raises `InputError` if the planner refuses."""
    if contender.technique in ("cpu", "march"):
        if cpu is None:
            raise InputError(contender.name, "Embree cannot be loaded", "pip install embreex")
        return cpu.plan(scene, scattering=SingleScattering())  # as the reference has it
    if contender.interfaces is not None:
        return studio.renderer.plan(scene, interfaces=contender.interfaces)
    if contender.engine is not None or contender.scattering is not None:
        return studio.renderer.plan(scene, scattering=contender.scattering or SingleScattering())
    if contender.technique == "plan":
        return studio.renderer.plan(scene, contender.method)
    return studio.renderer.plan(scene, BackFaceDepth() if contender.technique == "unmarked" else SignedDepth())
