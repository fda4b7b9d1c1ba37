"""Bakes of thickness, run by the Python that has the toolkit: ``python worker.py FOLDER``.

FOLDER holds ``meshes.npz`` and ``job.json``, which `baking.py` writes; results are ``image_0.npy``, ... and
``vertices_0.npy``, ... in it. Each line that is printed is an object of JSON, with progress or a warning.
"""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

import translucent as tl

#: Distance of a part from the surface of its body, as a fraction of the diagonal: that of rounding.
ON_SURFACE = 1e-4


class Bake:
    """One job: its bodies, and how much of it is done."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.job = json.loads((folder / "job.json").read_text("utf-8"))
        with np.load(folder / "meshes.npz") as arrays:
            self.arrays = {name: arrays[name] for name in arrays.files}
        self.steps = sum(len(image["parts"]) for image in self.job["images"]) + len(self.job["vertices"])
        self.done = 0
        self.bodies: dict[int, tl.Mesh] = {}

    def run(self) -> None:
        """Bake all images, then all vertices."""
        for number, image in enumerate(self.job["images"]):
            np.save(self.folder / f"image_{number}.npy", self.image(image))
        for number in self.job["vertices"]:
            with self.told():
                found = tl.bake_vertex_thickness(self.body(number), progress=self.report, **self.settings("vertices"))
            np.save(self.folder / f"vertices_{number}.npy", found.values)
            self.done += 1

    def settings(self, of: str) -> dict[str, Any]:
        """Settings that the toolkit takes for maps or for vertices."""
        maps_only = ("size", "padding", "supersample")
        return {key: value for key, value in self.job["settings"].items() if of == "maps" or key not in maps_only}

    def body(self, number: int) -> tl.Mesh:
        """Closed surface of an object, in metres."""
        if number not in self.bodies:
            vertices, faces = self.arrays[f"vertices_{number}"], self.arrays[f"faces_{number}"]
            made = tl.Mesh(vertices, faces, name=self.job["names"][number])
            if made.diagnosis.inverted:
                do = "use Mesh > Normals > Recalculate Outside in Edit Mode"
                raise tl.InputError(f"object {made.name!r}", "its faces look inwards", do)
            self.bodies[number] = made
        return self.bodies[number]

    def part(self, number: int, slot: int) -> tuple[tl.Mesh, bool]:
        """Faces of an object that have one material, with texture coordinates; and whether they are all of it."""
        chosen = self.arrays[f"slots_{number}"] == slot
        corners = self.arrays[f"faces_{number}"][chosen].reshape(-1)
        uv = self.arrays[f"uv_{number}"][chosen].reshape(-1, 2)
        rows, which = np.unique(np.column_stack([corners, uv]), axis=0, return_inverse=True)
        vertices = self.body(number).vertices[rows[:, 0].astype(np.int64)]
        faces = which.reshape(-1, 3).astype(np.int32)
        return tl.Mesh(vertices, faces, uv=rows[:, 1:], name=self.job["names"][number]), bool(chosen.all())

    def image(self, image: dict[str, Any]) -> np.ndarray:
        """(h, w) float32: thickness in metres of all objects that share an image, the top row first."""
        values = covered = None
        for number, slot in image["parts"]:
            mesh, whole = self.part(number, slot)
            settings = self.settings("maps") | {"tile": image["tile"]}
            if not whole:
                body = self.body(number)
                settings |= {"high": body, "high_distance": ON_SURFACE * body.diagonal}
            with self.told():
                found = tl.bake_thickness(mesh, progress=self.report, **settings)
            self.done += 1
            if values is None or covered is None:
                values, covered = found.values.copy(), found.coverage.copy()
                continue
            if shared := int((covered & found.coverage).sum()):
                before = f"{shared} texels of the image of {image['name']!r} with objects before it, which have them"
                say(warning=f"{mesh.name!r} shares {before}")
            free = (found.coverage & ~covered) | (~covered & ~found.coverage & (values == 0))
            values[free] = found.values[free]
            covered |= found.coverage
        assert values is not None
        return values

    def report(self, done: int, total: int, _: int) -> None:
        """Print how much of the job is done."""
        say(progress=(self.done + done / max(total, 1)) / self.steps)

    @contextmanager
    def told(self) -> Iterator[None]:
        """Print warnings of the toolkit as messages."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield
        for text in dict.fromkeys(str(one.message) for one in caught):
            say(warning=text)


def say(**message: Any) -> None:
    """Print a message, at once."""
    print(json.dumps(message), flush=True)


if __name__ == "__main__":
    try:
        Bake(Path(sys.argv[1])).run()
    except tl.TranslucentError as error:
        raise SystemExit(f"error: {error}") from None
