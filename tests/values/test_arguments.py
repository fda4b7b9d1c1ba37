"""Arguments of wrong types: each public function and constructor refuses them by an `InputError`."""

from __future__ import annotations

import inspect
import math
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from tests.values.handmade import ball
from translucent.arguments import brief, checked, checked_but, vectors

JADE = tl.Medium.from_color((0.2, 0.6, 0.4), 0.02, ior=1.5)
MILK = tl.Medium(absorption=(1, 1, 1), scattering=(1, 1, 1))
BODY = tl.Object(ball(1), medium=JADE)
CAMERA = tl.Camera.look_at((0, 0, 4), (0, 0, 0))
SCENE = tl.Scene([BODY], CAMERA, [tl.PointLight((2, 2, 2), (1, 1, 1))])
GRAY = tl.Environment.constant((0.5, 0.5, 0.5))
TEXTURE = tl.Texture(np.ones((2, 2, 4), np.float32))
GRID = tl.DensityGrid(np.ones((2, 2, 2)))
TRIANGLE = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]], "uv": [[0, 0], [1, 0], [0, 1]]}

#: Good arguments of what makes values, and of what computes some in no time.
GOOD: dict[Callable[..., Any], dict[str, Any]] = {
    tl.Backdrop: {"radiance": np.ones((4, 6, 3)), "depth": np.ones((4, 6)), "coverage": None, "ambient": (1, 1, 1)},
    tl.BakeSettings: {"mode": "cone", "size": 16, "rays": 4, "spread": 90.0, "max_distance": 1.0, "medium": JADE},
    tl.Camera: {"pose": np.eye(4), "fov_y": 45.0, "height": None, "window": None},
    tl.Camera.look_at: {"eye": (0, 0, 4), "target": (0, 0, 0), "up": (0, 1, 0), "fov_y": 45.0},
    tl.Camera.orthographic: {"eye": (0, 0, 4), "target": (0, 0, 0), "height": 1.0},
    tl.Camera.framing: {"points": ball(1).vertices, "size": (4, 4), "direction": (0, 0, -1), "fov_y": 30.0},
    CAMERA.rays: {"size": (4, 4), "offset": (0.0, 0.0)},
    tl.Capabilities: {"shader_storage": True, "texture_units": 32},
    tl.Caustics: {"photons": 100, "seed": 0},
    tl.DensityGrid: {"values": np.ones((2, 2, 2))},
    GRID.at: {"points": (0.5, 0.5, 0.5)},
    GRID.mean_between: {"start": np.zeros((1, 3)), "end": np.ones((1, 3))},
    tl.LinearDensity: {"axis": 0, "start": 1.0, "end": 2.0},
    tl.LinearDensity(0, 1.0, 2.0).at: {"points": (0.5, 0.5, 0.5)},
    tl.DepthPeeling: {"max_layers": 4, "order": "both-ends"},
    tl.Diffusion: {"resolution": 32},
    tl.DirectionalLight: {"direction": (0, -1, 0), "irradiance": (1, 1, 1)},
    tl.SphereLight: {"position": (0, 0, 0), "intensity": 1.0, "radius": 0.5},
    tl.SpotLight: {"position": (0, 0, 0), "direction": (0, -1, 0), "intensity": 1.0, "inner_cone": 1.0},
    tl.Draine: {"g": 0.5, "alpha": 1.0},
    tl.HenyeyGreenstein: {"anisotropy": 0.5},
    tl.HenyeyGreenstein(0.5).value: {"cos_scatter": 0.5},
    tl.HenyeyGreenstein(0.5).moments: {"count": 3},
    tl.WaterDroplets: {"diameter": 5e-6},
    tl.Environment.gradient: {"bottom": (1, 1, 1), "top": "white"},
    tl.Environment.checkerboard: {"first": (1, 1, 1), "tiles": 8.0},
    tl.Environment.image: {"source": np.ones((4, 8, 3)), "rotation": 0.0, "exposure": 0.0},
    GRAY.with_background: {"background": GRAY},
    GRAY.lighting: {"directions": (0, 0, 1)},
    tl.KBuffer: {"k": 8, "light_points": 8},
    tl.Medium: {"absorption": (1, 1, 1), "emission": 0, "anisotropy": 0.0, "ior": 1.0, "phase": None},
    tl.Medium.from_color: {"color": (0.5, 0.5, 0.5), "distance": 1.0, "ior": 1.0},
    tl.Medium.from_particles: {"number_density": 1.0, "radius": 1.0, "albedo": 0.5},
    JADE.transmittance: {"distance": 1.0},
    tl.Mesh: {**TRIANGLE, "name": "m", "repairs": (), "colors": None},
    ball(1).winding_number: {"point": (0, 0, 0)},
    ball(1).is_near: {"point": (0, 0, 0), "distance": 1.0},
    tl.Object: {
        "mesh": ball(1),
        "medium": JADE,
        "transform": np.eye(4),
        "priority": 0,
        "color": "red",
        "sheet_thickness": None,
        "density": None,
        "surface": None,
        "shadow_catcher": False,
    },
    BODY.winding_number: {"point": (0, 0, 0)},
    tl.PathTraced: {"paths": 4, "seed": 0},
    tl.Photograph: {"picture": np.ones((9, 9, 3)), "white": (0, 0, 3, 3), "patches": [((3, 3, 3, 3), 0.001)]},
    tl.Preset: {"name": "x", "medium": JADE, "kind": "estimated", "source": "me", "channel_anisotropy": (0, 0, 0)},
    tl.RayMarched: {"steps": 4, "quadrature": "midpoint", "jitter": False},
    tl.Scene: {"objects": [BODY], "camera": CAMERA, "lights": [], "environment": GRAY, "overlap": "add"},
    tl.ShadowMaps: {"size": 64, "directions": None},
    tl.SignedDepth: {"anchored": True},
    tl.Surface: {"roughness": 0.1, "color": (1, 1, 1), "color_texture": TEXTURE, "opacity": None, "double_sided": True},
    tl.Texture: {"pixels": np.ones((2, 2, 4)), "scale": (1, 1), "rotation": 0.0, "wrap": ("repeat", "repeat")},
    TEXTURE.sample: {"uv": (0.5, 0.5)},
    tl.ThinLayer: {"thickness": 1e-3},
    tl.TracedInterfaces: {"depth": 8, "forks": 2},
    tl.clamp_colors: {"colors": (0, 0.5, 1)},
    tl.color_at_distance: {"extinction": (1, 1, 1), "distances": 1.0},
    tl.condition_number: {"colors": (0.5, 0.5, 0.5)},
    tl.distance_for_color: {"extinction": (1, 1, 1), "color": (0.5, 0.5, 0.5)},
    tl.extinction_from_colors: {"colors": (0.5, 0.5, 0.5), "distances": 1.0},
    tl.fit_medium: {"distances": [1, 2], "colors": [(0.5, 0.5, 0.5), (0.25, 0.25, 0.25)], "weights": None, "ior": 1.0},
    tl.interior: {"hit_counts": np.ones((4, 4), int)},
    tl.average_color: {"seen": np.full((2, 2), 0.01), "medium": JADE},
    tl.medium_for_average_color: {"seen": np.full((2, 2), 0.01), "color": (0.5, 0.5, 0.5), "ior": 1.0},
    tl.plan: {"scene": SCENE, "method": None, "capabilities": None, "interfaces": None, "scattering": None},
    tl.preset: {"name": "jade"},
    tl.scattering_medium: {"color": (0.5, 0.5, 0.5), "mean_free_path": 0.01, "anisotropy": 0.0, "model": "hulst"},
    tl.showcase: {"mesh": ball(1), "medium": JADE, "size": (4, 4), "camera": None, "lights": (), "stage": None},
    tl.staged: {"scene": SCENE, "stage": "studio", "environment": None, "turn": 0.0},
    tl.text_block: {"target": "json", "medium": MILK, "color": MILK.transmittance(0.1), "distance": 0.1},
}


def nested(depth: int) -> Any:
    value: Any = 0
    for _ in range(depth):
        value = [value]
    return value


#: Values that belong nowhere, and values that belong somewhere else.
NEVER = [1j, object(), [1j, 1j, 1j], np.array([1j, 1, 1]), nested(1000), int]
SOMETIMES = [
    *(None, "x", "1", "a\0b", b"x", 10**400, -(10**400), math.nan, math.inf, True, 0, -1, 10**12, [], {}, {1, 2}),
    *([[1], [1, 2]], [None] * 3, ["1"] * 3, [10**400] * 3, np.array("x"), np.array([None]), (4.5, 4.5), np.eye(3)),
]


def name_of(function: Callable[..., Any]) -> str:
    return function.__qualname__


@pytest.mark.parametrize("function", GOOD, ids=name_of)
def test_a_wrong_argument_is_an_input_error(function: Callable[..., Any]) -> None:
    good = GOOD[function]
    function(**good)
    for name in good:
        for value in NEVER:
            with pytest.raises(tl.InputError) as caught:
                function(**{**good, name: value})
            assert len(str(caught.value)) <= 300
        for value in SOMETIMES:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", tl.TranslucentWarning)
                try:
                    function(**{**good, name: value})
                except tl.InputError:
                    continue


#: What nobody but the toolkit makes, results and errors; and what takes no arguments.
UNCHECKED = {
    *("Appearance", "BakeReport", "BatchReport", "DistanceMatch", "Errors", "Fit", "Frame", "Lithophane"),
    *("MaterialCheck", "MaterialFinding", "RenderPlan", "ScatterMap", "StepFit", "ThicknessMap", "Tile"),
    *("VertexScatter", "VertexThickness", "InputError", "RenderError", "TranslucentError", "TranslucentWarning"),
    *(
        "BackFaceDepth",
        "FrontInterface",
        "PhaseFunction",
        "ScatteringLayer",
        "ScreenInterfaces",
        "presets",
        "reference",
    ),
}


def test_everything_public_checks_its_arguments() -> None:
    for name in set(tl.__all__) - UNCHECKED:
        thing = getattr(tl, name)
        assert hasattr(thing.__init__ if inspect.isclass(thing) else thing, "__wrapped__"), name
    for one in (tl.Frame.save, tl.Frame.save_aovs, tl.ThicknessMap.save, tl.reference.render, tl.Renderer.render):
        assert hasattr(one, "__wrapped__")


# The tests of each kind of type


@checked
def taking(
    number: float = 1.0,
    whole: int = 1,
    flag: bool = True,
    text: str = "",
    path: str | Path = "",
    array: npt.ArrayLike = 0,
    pair: tuple[int, float] = (1, 1.0),
    many: Sequence[tl.Medium] = (),
    word: Literal["this", "that"] = "this",
    medium: tl.Medium | None = None,
    call: Callable[[], None] | None = None,
    unknown: Unheard | None = None,  # type: ignore[name-defined] # noqa: F821
    **others: Any,
) -> str:
    return "taken"


@pytest.mark.parametrize(
    "given",
    [
        {"number": 3, "whole": 3.0, "flag": np.bool_(True)},
        {"number": np.float32(3), "whole": np.uint8(3), "path": Path("x")},
        {"number": np.array(3.0), "array": [[1, 2.5], [3, True]], "pair": [1, 2]},
        {"whole": 10**400, "array": [10**30, 1.0], "pair": np.array([1, 2]), "many": [JADE, JADE]},
        {"many": (one for one in [JADE]), "word": "that", "medium": None, "call": print, "unknown": 1j, "other": 1j},
    ],
)
def test_what_is_of_the_type_is_taken(given: dict[str, Any]) -> None:
    assert taking(**given) == "taken"


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("number", "1", "taking number '1'; it is of type str; give a number"),
        ("number", None, "taking number None; it is None; give a number"),
        ("number", 10**400, "it is too large for float64"),
        ("whole", 2.5, "taking whole 2.5; it is not a whole number; give a whole number"),
        ("flag", "yes", "it is of type str; give True or False"),
        ("text", 3, "it is of type int; give a text"),
        ("path", "a\0b", "a file name cannot contain a null character; give a path"),
        ("path", "\ud800", "this text cannot be a file name"),
        ("path", b"x", "it is of type bytes; give a path"),
        ("array", [1j], "it is complex; give an array of numbers"),
        ("array", [[1], [1, 2]], "it cannot be converted to an array; give an array of numbers"),
        ("array", [10**400], "it contains a number that is too large for float64"),
        ("pair", (1, 2, 3), "it has 3 values, not 2; give (a whole number, a number)"),
        ("pair", (1, "x"), "in the element 'x': it is of type str"),
        ("many", [JADE, 3], "in the element 3: it is of type int; give a sequence, each a tl.Medium"),
        ("word", "those", "taking word 'those'; not known; give one of this, that"),
        ("medium", "jade", "it is of type str; give a tl.Medium or None"),
        ("call", 3, "it is of type int; give a function or None"),
    ],
)
def test_what_is_not_of_the_type_is_named(name: str, value: Any, message: str) -> None:
    with pytest.raises(tl.InputError) as caught:
        taking(**{name: value})
    assert message in str(caught.value)


def test_a_function_may_refuse_some_arguments_itself() -> None:
    @checked_but("left")
    def two(left: float, right: float) -> None:
        raise tl.InputError(f"left {left}")

    with pytest.raises(tl.InputError, match="left x"):
        two("x", 1.0)  # type: ignore[arg-type]
    with pytest.raises(tl.InputError, match="two right 'x'"):
        two(1.0, "x")  # type: ignore[arg-type]


def test_any_value_has_a_short_text() -> None:
    class Silent:
        def __repr__(self) -> str:
            raise KeyError("no")

    for value in (nested(10_000), 10**10_000, Silent(), "x" * 10**6, np.zeros((1000, 1000))):
        assert len(brief(value)) < 200


def test_vectors_are_finite_and_of_one_width() -> None:
    assert vectors("points", [[1, 2, 3]]).tolist() == [[1.0, 2.0, 3.0]]
    for value, message in (
        (1.0, r"of shape \(\); the last axis must have 3 numbers: \(\.\.\., 3\)"),
        ([1, 2], "give points of 3 numbers each"),
    ):
        with pytest.raises(tl.InputError, match=message):
            vectors("points", value)
    with pytest.raises(tl.InputError, match="points; not finite"):
        vectors("points", [1, 2, np.nan])
