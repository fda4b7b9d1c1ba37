"""Promise of a contender on a scene: the planner's notes, or what the shortcut leaves out."""

from __future__ import annotations

from translucent.bench.contenders import Contender
from translucent.bench.record import Quantity
from translucent.planning.notes import NoteKind
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan
from translucent.planning.scattering import Diffusion, Scattering, ScatteringLayer, SingleScattering
from translucent.scene.scene import Object, Scene

#: Light that a sum of one event each does not have; rows say so by their effect.
_LIT = (NoteKind.SCATTERED_AGAIN,)

#: Promises of the ways of showing light that is scattered many times: none has a bound.
_SCATTERED: dict[type[Scattering], str] = {
    Diffusion: "no bound: light diffuses, which it does a few mean free paths below the surface",
    ScatteringLayer: "no bound: exact for a wide flat slab in diffuse light; nothing spreads sideways",
    SingleScattering: "light of lamps that is scattered once; the rest is lost",
}

#: Effects that change pictures, but not the thickness along straight rays.
_BESIDE_THICKNESS = (
    *_LIT,
    NoteKind.LIGHTS_LEFT_OUT,
    NoteKind.ONLY_REMOVES,
    NoteKind.REFRACTION,
    NoteKind.LATER_REFRACTION,
    NoteKind.CUT_OFF_PATHS,
)


def promise_of(contender: Contender, plan: RenderPlan, scene: Scene, quantity: Quantity) -> tuple[str, bool]:
    """Promise of a row in a quantity, in words, and whether it is exact."""
    if contender.engine is not None:
        return contender.engine.promise, False
    if contender.scattering is not None:
        return _SCATTERED.get(type(contender.scattering)) or "; ".join(map(str, plan.limits)), False
    if contender.technique == "constant" and contender.interfaces is not None:
        return "none: the best constant thickness, and rays that bend once, where they enter", False
    if contender.technique in ("constant", "ball"):
        return "none: the nearest face alone, with the best thickness that there is", False
    if contender.technique == "unmarked":
        return "exact for convex bodies; says nothing where a body is not", False
    if contender.technique == "half":
        return "none: 11 bits for sums of signed distances", False
    if contender.technique == "march":
        return f"sums over {contender.method.light_points} steps in each interval", False
    if contender.method.marches and any(map(_shines, scene.bodies)):
        return f"sums over {contender.method.light_points} steps in each interval", False
    if plan.has(PassName.LIGHT_VIEWS):
        points = contender.method.light_points
        return f"{points} points of an interval look at the lights; {'; '.join(plan.limits)}".rstrip("; "), False
    if contender.kind == "counter-example" and contender.ior == "matched":
        return "none: interfaces are left out", False
    beside = _BESIDE_THICKNESS if quantity == "thickness" else _LIT
    missing = [effect for effect in plan.unmodelled if effect.kind not in beside]
    limits = [*plan.limits, *missing]
    return "; ".join(limits) or "exact", not limits


def _shines(body: Object) -> bool:
    """True if steps through the body add up any light."""
    medium = body.medium
    return medium is not None and (medium.emits or medium.scatters or body.density is not None)
