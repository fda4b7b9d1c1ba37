"""Truth of scattering scenes as the package brings it, path traced beforehand: see ``tools/scattering_truth.py``."""

from __future__ import annotations

import io
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.scene.lights import DirectionalLight, SpotLight
from translucent.scene.scene import Scene

#: Relative and absolute difference of parameters up to which a scene is the one whose truth is stored: rounding.
SAME, SAME_ZERO = 1e-6, 1e-9


@dataclass(frozen=True)
class StoredTruth:
    """Truth of a scene: two independent estimates of its radiance, with noise.

    Attributes
    ----------
    halves : (2, k, 3) float64
        Radiance of the pixels of the mask, row by row.
    error : (k, 3) float64
        Standard error of the mean of the two.
    mask : (h, w) bool
        Pixels that bodies cover.
    parameters : (n,) float64
        See `scene_parameters`.
    paths : int
        Of each pixel, in both halves together.
    seconds : float
        That they took.
    """

    halves: Array
    error: Array
    mask: npt.NDArray[np.bool_]
    parameters: Array
    paths: int
    seconds: float

    @property
    def noise(self) -> float:
        """Root mean square of the standard error, as a share of the mean radiance."""
        return float(np.sqrt((self.error**2).mean()) / self.halves.mean())

    def to_bytes(self) -> bytes:
        """Contents of its file: radiance in float16."""
        stream = io.BytesIO()
        np.savez_compressed(
            stream,
            halves=self.halves.astype(np.float16),
            error=self.error.astype(np.float16),
            mask=np.packbits(self.mask),
            size=np.array(self.mask.shape),
            parameters=self.parameters,
            paths=self.paths,
            seconds=self.seconds,
        )
        return stream.getvalue()

    @classmethod
    def from_bytes(cls, content: bytes) -> StoredTruth:
        """Truth of the contents of a file."""
        with np.load(io.BytesIO(content)) as found:
            size = tuple(found["size"].tolist())
            mask = np.unpackbits(found["mask"], count=int(np.prod(size))).reshape(size).astype(bool)
            return cls(
                found["halves"].astype(np.float64),
                found["error"].astype(np.float64),
                mask,
                found["parameters"],
                int(found["paths"]),
                float(found["seconds"]),
            )


def file_name(scene: str) -> str:
    """Name of the file with the truth of a scene."""
    return f"{scene.replace(' ', '_')}.npz"


def stored_truth(name: str, scene: Scene) -> StoredTruth:
    """Stored truth of a scene.

    Raises
    ------
    InputError
        If there is none, or it is of another scene than this one.
    """
    file = files("translucent.bench.scattering").joinpath("truth", file_name(name))
    if not file.is_file():
        raise InputError(f"truth of {name!r}", "none is stored", "run tools/scattering_truth.py")
    truth = StoredTruth.from_bytes(file.read_bytes())
    now = scene_parameters(scene)
    if now.shape != truth.parameters.shape or not np.allclose(now, truth.parameters, SAME, SAME_ZERO):
        raise InputError(
            f"truth of {name!r}",
            "the scene has changed since its truth was path traced",
            "run tools/scattering_truth.py",
        )
    return truth


def scene_parameters(scene: Scene) -> Array:
    """Fingerprint of a scene in numbers: what light does there depends on these, and they are equal up to rounding.

    Meshes go in by their number of faces, volume and moments. Of a mesh with other faces in the same place little
    would show.
    """
    found: list[npt.ArrayLike] = [
        scene.camera.pose,
        scene.camera.fov_y or scene.camera.height or 0.0,
        scene.environment.radiance(_AXES, np.zeros((6, 2))),
    ]
    for body in scene.objects:
        mesh, medium = body.mesh, body.medium
        found += [
            len(mesh.faces),
            len(mesh.vertices),
            mesh.volume,
            mesh.vertices.mean(axis=0),
            mesh.vertices.std(axis=0),
        ]
        found += [(mesh.vertices**3).mean(axis=0), body.matrix, 0.0 if body.surface is None else body.surface.roughness]
        if medium is not None:
            found += [medium.absorption, medium.scattering, medium.emission, medium.anisotropy, medium.ior]
    for light in scene.lights:
        if isinstance(light, DirectionalLight):
            found += [light.direction, light.irradiance]
        else:
            found += [light.position, light.intensity]
            found += [light.cone] if isinstance(light, SpotLight) else []
    return np.concatenate([np.ravel(np.asarray(one, np.float64)) for one in found])


_AXES = np.concatenate([np.eye(3), -np.eye(3)])
