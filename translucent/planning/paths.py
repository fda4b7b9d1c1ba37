"""The plan of a scene that random paths of light render: thickness as the planner finds it, and the paths."""

from __future__ import annotations

from dataclasses import replace

from translucent.errors import InputError
from translucent.media.medium import Medium
from translucent.planning.interfaces import Interfaces
from translucent.planning.methods import PathTraced
from translucent.planning.render_plan import Capabilities, RenderPlan
from translucent.planning.scattering import Scattering
from translucent.scene.scene import Object, Scene


def check_paths(
    scene: Scene,
    method: PathTraced,
    capabilities: Capabilities,
    interfaces: Interfaces | None,
    scattering: Scattering | None,
) -> None:
    """Raise `InputError` if paths cannot render a scene, or something is asked for that they take the place of."""
    for asked, what in ((interfaces, "interfaces"), (scattering, "scattering")):
        if asked is not None:
            raise InputError(f"{method} with {what}={asked}", f"paths take the place of {what}", "give one of the two")
    if not capabilities.opengl:
        found = "paths are followed by OpenGL, and this renderer works on the CPU"
        raise InputError(str(method), found, "use tl.reference.path_trace(scene, size, paths), or an OpenGL backend")
    method.check(scene)


def straight_scene(scene: Scene) -> Scene:
    """The scene without interfaces, and with media that only absorb: thickness and optical depth are the same."""
    media = {id(body.medium): Medium(body.medium.extinction) for body in scene.bodies if body.medium is not None}

    def straight(body: Object) -> Object:
        return body if body.medium is None else replace(body, medium=media[id(body.medium)], surface=None)

    return replace(scene, objects=[straight(item) for item in scene.objects], lights=())


def with_paths(scene: Scene, method: PathTraced, straight: RenderPlan) -> RenderPlan:
    """The plan of the paths, which follow the passes of the `straight_scene`."""
    return replace(
        straight,
        passes=(*straight.passes, *method.passes(scene, "asked for")),
        limits=(*straight.limits, *method.limits(scene)),
        unmodelled=method.unmodelled(scene),
        paths=method,
    )
