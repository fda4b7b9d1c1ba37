"""pyrender, imported as it has to be; tests that need it skip where it cannot be."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from translucent.geometry.solids import Box, Sphere
from translucent.interop.pyrender import load_pyrender


@pytest.fixture(scope="session")
def pyrender(renderer: tl.Renderer) -> ModuleType:
    """In the window system of the other tests' contexts, which here is none: PyOpenGL binds itself to one only."""
    context = renderer.gpu.context
    try:
        module = load_pyrender(context.backend)
    except tl.RenderError as error:
        pytest.skip(str(error))
    from translucent.interop._pyrender_bridge import why_not_in

    if why := why_not_in(context):
        pytest.skip(f"pyrender cannot draw here: {why}")
    return module


class Studio:
    """Scenes of pyrender for the tests, and the same as tl.Mesh."""

    def __init__(self, pyrender: ModuleType) -> None:
        self.pyrender = pyrender
        self.ball = Sphere(center=(0.0, 0.25, 0.0), radius=0.5).tessellate(32)
        self.box = Box(low=(0.5, -0.1, -0.9), high=(0.9, 0.9, -0.5)).tessellate()
        floor = [(-2, 0, -2), (2, 0, -2), (2, 0, 2), (-2, 0, 2)]
        self.floor = tl.Mesh(floor, [(0, 2, 1), (0, 3, 2)], name="floor")

    def mesh(self, mesh: tl.Mesh, color: tuple[float, float, float], **material: Any) -> Any:
        """Flat faces of a rough dielectric."""
        pyrender = self.pyrender
        rough = pyrender.MetallicRoughnessMaterial(
            baseColorFactor=[*color, 1.0], metallicFactor=0.0, roughnessFactor=1.0, **material
        )
        corners = mesh.vertices[mesh.faces].reshape(-1, 3)
        normals = np.repeat(mesh.face_normals, 3, axis=0)
        return pyrender.Mesh([pyrender.Primitive(corners, normals, material=rough)])

    def camera(self, kind: str) -> Any:
        """A camera that `pose` puts before the scene."""
        pyrender = self.pyrender
        if kind == "orthographic":
            return pyrender.OrthographicCamera(1.0, 0.8, znear=0.1, zfar=12.0)
        return pyrender.PerspectiveCamera(np.radians(30.0), znear=0.3, zfar=None if kind == "infinite" else 12.0)

    @property
    def pose(self) -> npt.NDArray[np.float64]:
        """Pose of the camera."""
        return tl.Camera.look_at((1.4, 1.2, 3.2), (0.1, 0.3, 0.0)).pose

    def scene(self, kind: str = "perspective") -> Any:
        """A ball, sunk into a floor, before a box, with a lamp and the sun."""
        pyrender = self.pyrender
        scene = pyrender.Scene(bg_color=[0.5, 0.6, 0.9, 1.0], ambient_light=[0.2, 0.2, 0.25])
        scene.add(self.mesh(self.floor, (0.7, 0.6, 0.5)), name="floor")
        scene.add(self.mesh(self.box, (0.2, 0.3, 0.8)), name="box")
        scene.add(self.mesh(self.ball, (0.9, 0.9, 0.9)), name="ball")
        scene.add(self.camera(kind), pose=self.pose)
        lamp = np.eye(4)
        lamp[:3, 3] = (-1.0, 2.5, 1.0)
        scene.add(pyrender.PointLight(color=np.ones(3), intensity=6.0), pose=lamp)
        sun = tl.Camera.look_at((1.0, 3.0, 0.5), (0.0, 0.0, 0.0)).pose
        scene.add(pyrender.DirectionalLight(color=[1.0, 0.9, 0.8], intensity=1.5), pose=sun)
        return scene


@pytest.fixture(scope="session")
def studio(pyrender: ModuleType) -> Studio:
    return Studio(pyrender)
