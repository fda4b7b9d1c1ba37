"""Media as nodes of Blender, there and back, and the snippet that makes them."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import translucent as tl
from tests.values.media import CLEAR, GLOW, JADE, MILK, close
from translucent.materials.blender import (
    BOUNCES,
    absorption_node,
    blender_snippet,
    from_absorption_node,
    from_principled_node,
    principled_node,
)

sigma = st.floats(0, 1e4).map(lambda v: 0.0 if v < 1e-6 else v)
triples = st.tuples(sigma, sigma, sigma)


def test_blender_absorption_is_no_color_at_a_distance() -> None:
    medium = from_absorption_node((0.5, 0.5, 0.5), 1.0)
    np.testing.assert_allclose(medium.extinction, 0.5)  # and not ln 2 = 0.693
    color, density = absorption_node(tl.Medium.from_color((0.5, 0.5, 0.5), 1.0))
    np.testing.assert_allclose((1.0 - color) * density, math.log(2), rtol=1e-15)


@given(triples)
def test_blender_absorption_there_and_back(absorption: tuple[float, float, float]) -> None:
    medium = tl.Medium(absorption=absorption)
    color, density = absorption_node(medium)
    assert ((color >= 0) & (color <= 1)).all()
    close(from_absorption_node(color, density), medium, 1e-15)


@given(triples, triples)
def test_blender_principled_there_and_back(
    absorption: tuple[float, float, float], scattering: tuple[float, float, float]
) -> None:
    medium = tl.Medium(absorption=absorption, scattering=scattering)
    with np.errstate(under="ignore"):
        color, absorb, density = principled_node(medium)
        assert ((color >= 0) & (color <= 1) & (absorb >= 0) & (absorb <= 1)).all()
        close(from_principled_node(color, absorb, density), medium, 1e-12)


def test_blender_values_out_of_range_are_refused() -> None:
    with pytest.raises(tl.InputError, match=r"the color must be three numbers in 0\.\.1"):
        from_absorption_node((1.5, 0, 0), 1.0)
    with pytest.raises(tl.InputError, match="Density"):
        from_absorption_node((0.5, 0, 0), -1.0)


@pytest.mark.parametrize("version", [4, 5])
@pytest.mark.parametrize("medium", [JADE, MILK, GLOW, CLEAR], ids=["jade", "milk", "glow", "clear"])
@pytest.mark.parametrize("roughness", [0.0, 0.3])
def test_the_blender_snippet_runs_and_sets_the_sockets(
    medium: tl.Medium, version: int, roughness: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: dict[str, Any] = {}

    class Sockets(dict[str, Any]):
        def __missing__(self, key: str) -> Any:
            return self.setdefault(key, SimpleNamespace(default_value=None))

    def new(kind: str) -> Any:
        return made.setdefault(kind, SimpleNamespace(inputs=Sockets(), outputs=Sockets()))

    tree = SimpleNamespace(
        nodes=SimpleNamespace(new=new, clear=made.clear),
        links=SimpleNamespace(new=lambda a, b: made.update(link=(a, b))),
    )

    class Material:
        """Up to version 4 it has nodes only once `use_nodes` is set; from 5 on, setting it is deprecated."""

        node_tree = tree if version == 5 else None

        def __setattr__(self, key: str, value: Any) -> None:
            assert (version, key, value) == (4, "use_nodes", True)
            Material.node_tree = tree

    light = {"max_bounces": 12, "volume_bounces": 0, "glossy_bounces": 4, "transmission_bounces": 2048}
    scene = SimpleNamespace(cycles=SimpleNamespace(**light))
    materials = SimpleNamespace(new=lambda name: Material())
    bpy = SimpleNamespace(data=SimpleNamespace(materials=materials), context=SimpleNamespace(scene=scene))
    monkeypatch.setitem(__import__("sys").modules, "bpy", bpy)
    exec(compile(blender_snippet(medium, roughness), "snippet", "exec"), {})
    absorbing = "ShaderNodeVolumeAbsorption" in made
    volume = made["ShaderNodeVolumeAbsorption" if absorbing else "ShaderNodeVolumePrincipled"]
    values = {key: socket.default_value for key, socket in volume.inputs.items()}
    if absorbing:
        found = from_absorption_node(values["Color"][:3], values["Density"])
    else:
        found = from_principled_node(
            values["Color"][:3], values["Absorption Color"][:3], values["Density"], values["Anisotropy"]
        )
        assert found.anisotropy == medium.anisotropy
        q = values["Emission Strength"] * np.array(values["Emission Color"][:3])
        np.testing.assert_allclose(q, medium.emission, rtol=1e-15)
    close(found, medium)
    assert "link" in made
    raised = {kind: max(BOUNCES, count) for kind, count in light.items()} if medium.scatters or roughness else light
    assert vars(scene.cycles) == raised
    del scene.cycles  # another renderer alone
    exec(compile(blender_snippet(medium, roughness), "snippet", "exec"), {})
