"""Bodies and scenes for the planner."""

from __future__ import annotations

from typing import Any

import trimesh

import translucent as tl
from translucent.planning.plan import plan_scene
from translucent.planning.render_plan import Capabilities, RenderPlan
from translucent.planning.rendered import Treatment
from translucent.planning.request import RenderRequest

_BOX = trimesh.creation.box((1, 1, 1))
BOX = tl.Mesh(_BOX.vertices, _BOX.faces, name="box")
OPEN = tl.Mesh(_BOX.vertices, _BOX.faces[1:], name="open box")
_TORUS = trimesh.creation.torus(1.0, 0.25, major_sections=12, minor_sections=8)
TORUS = tl.Mesh(_TORUS.vertices, _TORUS.faces, name="torus")
CAMERA = tl.Camera.look_at((0, 0, 20), (0, 0, 0))

GLASS, WINE = tl.Medium(absorption=1.0), tl.Medium(absorption=(1, 2, 3))
FIRE, EMBER = tl.Medium(absorption=1.0, emission=(3, 1, 0)), tl.Medium(absorption=1.0, emission=(1, 1, 0))
MILK, DIAMOND = tl.Medium(scattering=1.0), tl.Medium(absorption=1.0, ior=2.4)
NO_STORAGE = Capabilities(shader_storage=False)
ORDERED = [tl.DepthPeeling(), tl.FragmentLists(), tl.KBuffer()]


def body(medium: tl.Medium | None = GLASS, mesh: tl.Mesh = BOX, x: float = 0.0, **options: Any) -> tl.Object:
    return tl.Object(mesh, medium, trimesh.transformations.translation_matrix((x, 0, 0)), **options)


def sheet(medium: tl.Medium = GLASS, mesh: tl.Mesh = BOX, x: float = 0.0) -> tl.Object:
    return body(medium, mesh, x, sheet_thickness=1e-3)


def scene(*objects: tl.Object, **options: Any) -> tl.Scene:
    return tl.Scene(objects, CAMERA, **options)


def names(found: RenderPlan) -> list[str]:
    return [step.name for step in found.passes]


SCENES = {
    "convex": scene(body()),
    "concave": scene(body(mesh=TORUS)),
    "sheets": scene(sheet(), sheet(WINE)),
    "body and sheet": scene(body(), sheet()),
    "open": scene(body(mesh=OPEN)),
    "open and closed": scene(body(mesh=OPEN), body()),
    "opaque": scene(body(), body(None)),
    "media": scene(body(), body(WINE)),
    "emission": scene(body(FIRE)),
    "emission among media": scene(body(FIRE), body(WINE)),
    "emission and sheet": scene(body(FIRE), sheet(WINE)),
    "union": scene(body(), body(x=0.5), overlap="union"),
    "union, media": scene(body(), body(WINE), overlap="union"),
    "union, emission": scene(body(FIRE), body(FIRE, x=0.5), overlap="union"),
    "union, apart": scene(body(), body(WINE, x=3), overlap="union"),
    "priority": scene(body(), body(WINE, priority=1), overlap="priority"),
    "priority, apart": scene(body(), body(WINE, x=3), overlap="priority"),
    "everything": scene(body(FIRE), sheet(), body(WINE, OPEN), body(None), overlap="union"),
}

#: Methods that do not order what a ray hits, and the planner's choice.
COLUMNS = (None, tl.SignedDepth(), tl.BackFaceDepth(), tl.ThinLayer())


def plan_over_backdrop(
    given: tl.Scene, method: Any = None, capabilities: Capabilities | None = None, **choices: Any
) -> RenderPlan:
    return plan_scene(given, RenderRequest(method, over_backdrop=True, **choices), capabilities)


def many_times(found: RenderPlan) -> bool:
    """True if a plan shows multiple scattering."""
    return bool(found.treated(Treatment.LAYER, Treatment.DIFFUSION, Treatment.VOLUME))
