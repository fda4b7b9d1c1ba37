"""OpenPBR and Standard Surface as we read them, against the node graphs that MaterialX ships with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import translucent as tl
from translucent.materials.materialx import OPENPBR, STANDARD_SURFACE, SurfaceShader, medium_of

Values = Mapping[str, Any]


@pytest.fixture(scope="module")
def library() -> Any:
    mx = pytest.importorskip("MaterialX", reason="the materialx package is absent")
    document = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), document)
    return document


def graph_of(library: Any, definition: str) -> Any:
    return library.getNodeDef(definition).getImplementation()


class Graph:
    """Values of the nodes of a node graph, for values of its interface."""

    def __init__(self, graph: Any, interface: Values) -> None:
        self.graph, self.interface = graph, interface

    def node(self, name: str) -> Any:
        found = self.graph.getNode(name)
        inputs = {item.getName(): self.value(item) for item in found.getInputs()}
        return _OPERATIONS[found.getCategory()](inputs)

    def value(self, item: Any) -> Any:
        if item.getNodeName():
            return self.node(item.getNodeName())
        if item.hasInterfaceName():
            return self.interface[item.getInterfaceName()]
        value = item.getValue()
        return value if isinstance(value, int | float) else np.array(tuple(value))


_OPERATIONS = {
    "dot": lambda i: i["in"],
    "convert": lambda i: i["in"] * np.ones(3),
    "ln": lambda i: np.log(i["in"]),
    "multiply": lambda i: i["in1"] * i["in2"],
    "divide": lambda i: i["in1"] / i["in2"],
    "subtract": lambda i: i["in1"] - i["in2"],
    "extract": lambda i: i["in"][i["index"]],
    "min": lambda i: min(i["in1"], i["in2"]),
    "ifgreater": lambda i: i["in1"] if i["value1"] > i["value2"] else i["in2"],
    "anisotropic_vdf": lambda i: i,
}


def stated(shader: SurfaceShader, rng: np.random.Generator) -> dict[str, Any]:
    """Random inputs, about half of them with more scattering than extinction in some channel."""
    return {
        shader.weight: 1.0,
        shader.color: rng.uniform(0.01, 1.0, 3),
        shader.depth: float(10 ** rng.uniform(-3, 1)),
        shader.scatter: rng.uniform(0.0, 1.0, 3) * rng.integers(0, 2),
        shader.anisotropy: float(rng.uniform(-0.9, 0.9)),
        shader.ior: float(rng.uniform(1.0, 2.0)),
    }


def test_the_medium_is_the_one_that_the_graph_of_openpbr_computes(library: Any, rng: np.random.Generator) -> None:
    definition = library.getNodeDef("ND_open_pbr_surface_surfaceshader")
    version = definition.getVersionString()
    if not version.startswith(("1.0", "1.1")):
        pytest.skip(f"the graph is of OpenPBR {version}, where the scatter color is an albedo")
    shifted = 0
    for _ in range(100):
        inputs = stated(OPENPBR, rng)
        volume = Graph(graph_of(library, definition.getName()), inputs).node("dielectric_volume")
        medium = medium_of(OPENPBR, inputs, 1.0)
        scale = float(medium.extinction.max())
        np.testing.assert_allclose(medium.absorption, volume["absorption"], rtol=0, atol=1e-12 * scale)
        np.testing.assert_allclose(medium.scattering, volume["scattering"], rtol=0, atol=1e-12 * scale)
        assert medium.anisotropy == volume["anisotropy"]
        shifted += bool((-np.log(inputs[OPENPBR.color]) < inputs[OPENPBR.scatter]).any())
    assert 20 < shifted < 80


@pytest.mark.parametrize(("source", "target"), [(OPENPBR, STANDARD_SURFACE), (STANDARD_SURFACE, OPENPBR)])
def test_materialx_translates_the_two_into_each_other_input_by_input(
    library: Any, rng: np.random.Generator, source: SurfaceShader, target: SurfaceShader
) -> None:
    inputs = stated(source, rng)
    graph = graph_of(library, f"ND_{source.node}_to_{target.node}")
    values = Graph(graph, inputs)
    translated = {
        key: values.node(graph.getOutput(f"{key}_out").getNodeName())
        for key in (target.weight, target.color, target.depth, target.scatter, target.anisotropy, target.ior)
    }
    assert medium_of(target, translated, 0.01) == medium_of(source, inputs, 0.01)


def test_the_graph_of_standard_surface_itself_has_no_depth(library: Any) -> None:
    graph = graph_of(library, "ND_standard_surface_surfaceshader")
    read = {item.getInterfaceName() for node in graph.getNodes() for item in node.getInputs()}
    assert STANDARD_SURFACE.color in read
    assert not {STANDARD_SURFACE.depth, STANDARD_SURFACE.scatter} & read


@pytest.mark.parametrize("shader", [OPENPBR, STANDARD_SURFACE])
def test_the_defaults_are_those_of_the_definition(library: Any, shader: SurfaceShader) -> None:
    definition = library.getNodeDef(f"ND_{shader.node}_surfaceshader")
    for key, default in shader.defaults().items():
        value = definition.getActiveInput(key).getValue()
        assert np.array_equal(np.array(value if isinstance(value, float) else tuple(value)), default), key


def test_a_later_openpbr_that_scatters_is_refused() -> None:
    milk = tl.Medium(absorption=(1.4, 2.5, 14.2), scattering=(7, 12, 19))
    for medium, version, readable in (
        (milk, "1.1.1", True),
        (milk, "1.2", False),
        (milk, "1.10", False),
        (milk, "2.0.1", False),
        (tl.Medium(absorption=(1, 2, 3)), "1.2", True),
    ):
        text = OPENPBR.write(medium).replace("<open_pbr_surface ", f'<open_pbr_surface version="{version}" ')
        if readable:
            np.testing.assert_allclose(OPENPBR.read(text).extinction, medium.extinction, rtol=1e-12)
        else:
            with pytest.raises(
                tl.InputError, match=f"version {version}, in which the scatter color has another meaning"
            ):
                OPENPBR.read(text)
