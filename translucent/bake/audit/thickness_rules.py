"""Findings about stated thickness: against the true one, and what color passes.

A factor is right where it is near some honest measure of the body: the median along normals, around them (what a bake
of mode cone holds), or along views. Between the smallest and the largest of them nothing is found.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence

import numpy as np

from translucent.arrays import Array
from translucent.bake.audit.body import Body
from translucent.bake.audit.finding import MaterialFinding, Severity
from translucent.formulas.color import to_hex
from translucent.media.medium import Medium, extinction_at
from translucent.units import length_text

#: Ratios of stated to true thickness beyond which it is told, and beyond which it is an error.
SUSPECT, WRONG = 1.5, 3.0

#: A wall is this share of the smallest side of the body at most; the thickness of the body is within this factor of it.
WALL_SHARE, OF_THE_BODY = 0.3, 2.0

#: Rank correlation below which a map is dark where the body is thick, and the least spread that has a meaning.
INVERTED, SPREAD = -0.3, 1.5

#: Share of the true thickness below which a map has no value, and the share of the surface from which on it is told.
NO_VALUE, MUCH = 0.01, 0.1

#: Share of the surface from which on it is told that a map is off there by more than `WRONG`.
MUCH_OFF = 0.25

#: Transmittance that an 8-bit picture shows as black, and the one that it shows as white.
BLACK, WHITE = 1.0 / 255.0, 254.0 / 255.0

#: A medium in a body of the right size passes light between these.
PLAUSIBLE = (0.05, 0.95)

#: Units that files are written in by mistake, by their length in metres.
UNITS = (("centimetres", 0.01), ("millimetres", 0.001), ("inches", 0.0254))

#: Thickness in metres, along views, outside of which translucent bodies are rare.
USUAL = (1e-5, 0.5)


def thickness_findings(body: Body) -> Iterator[MaterialFinding]:
    """Findings about the thickness that a body's material states."""
    if body.texture_problem:
        do = "export it with these texture coordinates, or let --fix bake a texture"
        yield _found(body, "error", "thickness-texture-unreadable", body.texture_problem, do)
    if body.material.thickness == 0:
        yield from _without_thickness(body)
        return
    yield from _against_truth(body)
    if body.material.has_thickness_texture and not body.texture_problem:
        yield from _map_findings(body)


def attenuation_findings(body: Body) -> Iterator[MaterialFinding]:
    """Findings about the color that passes a body, and about its size."""
    lengths = body.chords * body.world_views()
    thick = float(np.median(lengths[np.isfinite(lengths)])) if np.isfinite(lengths).any() else 0.0
    if thick == 0 or body.material.medium() is None:
        return
    extinction = extinction_of(body)
    passed = Medium(absorption=extinction).transmittance(thick)
    at = f"at its true thickness of {length_text(thick)} (median along views)"
    told = False
    if extinction.any() and passed.max() < BLACK:
        do = "raise attenuationDistance, or brighten attenuationColor"
        yield _found(body, "warning", "attenuation-black", f"{at} nothing passes: it is black", do)
        told = yield from _units(body, thick, extinction, UNITS)
    elif extinction.any() and passed.min() > WHITE:
        text = f"{at} {to_hex(passed)} passes: attenuation has no effect that can be seen"
        yield _found(body, "warning", "attenuation-none", text, "lower attenuationDistance")
        told = yield from _units(body, thick, extinction, [(name, 1.0 / size) for name, size in UNITS[:2]])
    if not told and not USUAL[0] <= thick <= USUAL[1]:
        scale = 0.01 if thick > USUAL[1] else 100.0
        text = f"it is {length_text(thick)} thick along views, and what light passes is rarely so"
        do = (
            f"check the unit: glTF is in metres; should it be {length_text(scale * thick)}, scale its node by {scale:g}"
        )
        yield _found(body, "note", "size-unusual", text, do)


def extinction_of(body: Body) -> Array:
    """(3,): extinction that the material states, in 1/m of the world."""
    return extinction_at(body.material.attenuation_color, body.material.attenuation_distance)


def _without_thickness(body: Body) -> Iterator[MaterialFinding]:
    material = body.material
    if not material.has_volume or not extinction_of(body).any():
        return
    text = "thicknessFactor is 0 beside an attenuation: viewers draw a thin wall and show none of it"
    if body.mesh.diagnosis.closed:
        thick = length_text(float(np.nanmedian(np.where(np.isfinite(body.beneath), body.beneath, np.nan))))
        do = f"write the thickness of the mesh, {thick} along its normals in mesh space (--fix bakes it)"
        yield _found(body, "error", "thickness-zero", text, do)
    else:
        yield _found(body, "warning", "thickness-zero", text, "remove the attenuation, or close the mesh")


def _against_truth(body: Body) -> Iterator[MaterialFinding]:
    known = [value for value in body.typical if np.isfinite(value) and value > 0]
    stated = float(np.median(body.stated))
    if not known or stated <= 0:
        return
    low, high = min(known), max(known)
    ratio = stated / high if stated > high else low / stated if stated < low else 1.0
    if ratio <= SUSPECT:
        return
    side = float(np.ptp(body.mesh.bounds, axis=0).min())
    beneath = body.typical[0]
    if stated > high and beneath < WALL_SHARE * side and side / OF_THE_BODY <= stated <= OF_THE_BODY * side * 1.5:
        text = (
            f"the mesh is a shell with walls of {beneath:.3g}, and the thickness stated, {stated:.3g}, is that of the "
            f"whole body (mesh space)"
        )
        do = f"state the thickness of the wall, {beneath:.3g} (--fix bakes it), or remove the inner surface"
        yield _found(body, "error", "shell-as-solid", text, do)
        return
    severity: Severity = "error" if ratio >= WRONG and extinction_of(body).any() else "warning"
    code = f"thickness-too-{'large' if stated > high else 'small'}"
    yield _found(body, severity, code, _compared(body, stated, ratio), _advice(body, code, low, high))


def _compared(body: Body, stated: float, ratio: float) -> str:
    beneath, around, chords = body.typical
    ends = [np.percentile(values[np.isfinite(values)], 95) for values in (body.beneath, body.chords)]
    per_metre = float(np.median(body.world_normals()))
    text = (
        f"stated {stated:.3g} (median), true {beneath:.3g} along normals (p95 {ends[0]:.3g}), {chords:.3g} along views "
        f"(p95 {ends[1]:.3g}), {around:.3g} around normals, in mesh space, where 1 is {length_text(per_metre)}: "
        f"{ratio:.3g} times off"
    )
    if not extinction_of(body).any():
        return f"{text}; nothing attenuates, so that only the bend of what is behind is wrong"
    shown, true = mean_colors(body)
    return f"{text}; it shows {to_hex(shown)} where {to_hex(true)} passes"


def _advice(body: Body, code: str, low: float, high: float) -> str:
    span = f"{low:.3g}" if high < 1.05 * low else f"{low:.3g} to {high:.3g}"
    do = f"write thicknessFactor {span}" + (" (--fix bakes a map)" if body.mesh.diagnosis.closed else "")
    if code == "thickness-too-small":
        return f"{do}; if a hollow body is meant, its mesh lacks the inner surface, and ray tracers fill it"
    return do


def mean_colors(body: Body) -> tuple[Array, Array]:
    """Mean colors that pass over all views: with the stated length along each ray, and with the true one."""
    medium, world = Medium(absorption=extinction_of(body)), body.world_views()
    finite = np.isfinite(body.chords)
    if not finite.any():
        return np.ones(3), np.ones(3)
    with np.errstate(under="ignore"):
        shown, true = (
            medium.transmittance(part[finite] * world[finite]).mean(axis=0) for part in (body.seen_stated, body.chords)
        )
    return shown, true


def _map_findings(body: Body) -> Iterator[MaterialFinding]:
    from scipy.stats import rankdata

    finite = np.isfinite(body.around) & (body.around > 0)
    stated, true = body.stated[finite], body.around[finite]
    if len(true) < 2:
        return
    empty = float(np.mean(stated < NO_VALUE * true))
    if empty > MUCH:
        text = f"the thickness texture is black on {empty:.0%} of the surface, where viewers show no attenuation"
        yield _found(body, "warning", "thickness-map-empty", text, "bake it again (--fix)")
    low, high = np.percentile(true, [10, 90])
    if high > SPREAD * low and np.ptp(stated) > 0:
        correlation = float(np.corrcoef(rankdata(stated), rankdata(true))[0, 1])
        if correlation < INVERTED:
            text = f"the thickness texture is dark where the mesh is thick (rank correlation {correlation:.2f})"
            yield _found(body, "error", "thickness-map-inverted", text, "invert it: white is thick (--fix bakes it)")
            return
    below, above = np.minimum(body.beneath[finite], true), np.maximum(body.beneath[finite], true)
    off = float(np.mean((stated > WRONG * above) | (WRONG * stated < below)))
    if off > MUCH_OFF and off > empty:
        text = f"the thickness texture is more than {WRONG:g} times off on {off:.0%} of the surface"
        yield _found(body, "warning", "thickness-map-off", text, "bake it again (--fix): it may be of another mesh")


def _units(
    body: Body, thick: float, extinction: Array, units: Sequence[tuple[str, float]]
) -> Generator[MaterialFinding, None, bool]:
    """Yield a finding, and return True, if the medium would suit a body of another size."""
    for name, scale in units:
        passed = Medium(absorption=extinction).transmittance(scale * thick)
        if passed.max() > PLAUSIBLE[0] and passed.min() < PLAUSIBLE[1]:
            small = scale < 1
            meant = "its lengths were in" if small else "its attenuation was meant for"
            text = (
                f"{length_text(thick)} thick it is {'black' if small else 'clear'}; {length_text(scale * thick)} thick "
                f"it would be {to_hex(passed)}, as if {meant} {name}"
            )
            do = f"glTF is in metres: scale its node by {scale:g}, or attenuationDistance by {1 / scale:g}"
            yield _found(body, "warning", "units-suspect", text, do)
            return True
    return False


def _found(body: Body, severity: Severity, code: str, text: str, do: str) -> MaterialFinding:
    return MaterialFinding(severity, code, body.where, text, do, body.material.index, body.key)
