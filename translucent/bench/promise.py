"""What a contender promises on a scene: the planner's own words, or what the shortcut leaves out."""

from __future__ import annotations

from translucent.bench.contenders import Contender
from translucent.bench.row import Quantity
from translucent.planning.methods import RayMarched
from translucent.planning.render_plan import RenderPlan
from translucent.scene.scene import Object, Scene


def promise_of(contender: Contender, plan: RenderPlan, scene: Scene, quantity: Quantity) -> tuple[str, bool]:
    """What the row promises in that quantity, in words, and whether that is to be exact."""
    if contender.technique in ("constant", "ball"):
        return "none: the nearest face alone, with the best thickness that there is", False
    if contender.technique == "unmarked":
        return "exact for convex bodies; says nothing where a body is not", False
    if contender.technique == "half":
        return "none: 11 bits for sums of signed distances", False
    if contender.technique == "march":
        return f"sums over {getattr(contender.method, 'steps', 0)} steps in each interval", False
    if isinstance(contender.method, RayMarched) and any(map(_shines, scene.bodies)):
        return f"sums over {contender.method.steps} steps in each interval", False
    if any(step.name == "light_views" for step in plan.passes):
        points = getattr(contender.method, "light_points", 0)
        return f"{points} points of an interval look at the lights; {'; '.join(plan.limits)}".rstrip("; "), False
    if contender.kind == "counter-example" and contender.ior == "matched":
        return "none: borders are left out", False
    # Thickness is that of straight rays.
    lit = ("light scattered more",)
    beside = (*lit, "in-scattered light", "refraction") if quantity == "thickness" else lit
    missing = [effect for effect in plan.unmodelled if not effect.startswith(beside)]
    limits = [*plan.limits, *missing]
    return "; ".join(limits) or "exact", not limits


def _shines(body: Object) -> bool:
    """Whether steps through the body add something up."""
    medium = body.medium
    return medium is not None and (medium.emits or medium.scatters or body.density is not None)
