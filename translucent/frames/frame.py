"""The one result type of every renderer, and how it is written to disk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError, RenderError
from translucent.extras import require_package
from translucent.files.paths import require_folder, require_place, write_atomically
from translucent.formulas.color import exposure_scale, linear_to_srgb
from translucent.formulas.tone import tone_curve
from translucent.planning.render_plan import RenderPlan

#: The arrays of a frame, under the names that .npz files use.
ARRAYS = ("radiance", "transmittance", "optical_depth", "thickness", "coverage", "valid")

#: More of them, that frames of ordered methods have.
LAYER_ARRAYS = ("layers", "truncated")

#: What frames without a background have, and those of bodies with borders.
MATTE_ARRAYS = ("alpha", "normals")

#: Of files that hold a frame.
SUFFIXES = (".png", ".exr", ".npz")

#: Stops beyond which radiance would leave what float64 can hold, or be black for sure.
MAX_EXPOSURE = 100.0


@dataclass(frozen=True, eq=False)
class Frame:
    """A rendered picture with its physical quantities. Row 0 is the top row; arrays are contiguous and the caller's.

    Attributes
    ----------
    radiance, transmittance, optical_depth : (h, w, 3) float
        Linear RGB.
    thickness : (h, w) float
        Path length inside media along the pixel's ray, in metres.
    coverage : (h, w) bool
        A medium was crossed.
    valid : (h, w) bool
        The numbers can be trusted.
    plan : RenderPlan
        What ran and why.
    seconds : dict of str to float
        Time per pass, over all samples, and ``total`` for the whole call.
    provenance : dict of str to str
        Backend, driver and versions.
    layers : (h, w) int32, optional
        Surfaces of media that the pixel's ray crosses, those behind an orthographic picture included; only of methods
        that find ordered intervals.
    truncated : (h, w) int32, optional
        How many of them the method had to leave out.
    alpha : (h, w) float, optional
        Of a frame rendered without the environment behind: share of what is behind that it hides, the mean of the
        channels. The radiance is then that of the frame alone: an associated (premultiplied) color.
    normals : (h, w, 3) float, optional
        Unit normals, in world axes, of the borders where rays enter bodies; 0 where there is none. Only of frames whose
        plan has borders.
    """

    radiance: npt.NDArray[Any]
    transmittance: npt.NDArray[Any]
    optical_depth: npt.NDArray[Any]
    thickness: npt.NDArray[Any]
    coverage: npt.NDArray[np.bool_]
    valid: npt.NDArray[np.bool_]
    plan: RenderPlan
    seconds: Mapping[str, float] = field(default_factory=dict)
    provenance: dict[str, str] = field(default_factory=dict)
    layers: npt.NDArray[np.int32] | None = None
    truncated: npt.NDArray[np.int32] | None = None
    alpha: npt.NDArray[Any] | None = None
    normals: npt.NDArray[Any] | None = None

    def __repr__(self) -> str:
        covered, invalid = int(self.coverage.sum()), int((~self.valid).sum())
        return f"Frame({self.size[0]}x{self.size[1]}, {covered} pixels covered, {invalid} invalid)"

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.thickness.shape[1], self.thickness.shape[0]

    def summary(self) -> dict[str, Any]:
        """What happened, in numbers that JSON can hold; thickness in metres over the valid, covered pixels."""
        seen = self.thickness[self.coverage & self.valid]
        found: dict[str, Any] = {
            "size": list(self.size),
            "plan": self.plan.summary(),
            "seconds": dict(self.seconds),
            "provenance": dict(self.provenance),
            "covered_pixels": int(self.coverage.sum()),
            "invalid_pixels": int((~self.valid).sum()),
            "thickness": {"median": float(np.median(seen)), "max": float(seen.max())} if seen.size else None,
        }
        if self.layers is not None and self.truncated is not None:
            found["layers"] = {"max": int(self.layers.max()), "truncated_pixels": int((self.truncated > 0).sum())}
        return found

    def to_srgb8(self, exposure: float = 0.0, tone: str = "none") -> npt.NDArray[np.uint8]:
        """(h, w, 3) uint8: the radiance, `exposure` stops brighter, through a tone curve and sRGB-encoded.

        A frame with `alpha` gives (h, w, 4) with colors that are not multiplied by it, as PNG has them. Where it shines
        more than it hides, alpha is raised to what the brightest channel needs.

        Parameters
        ----------
        exposure : float
            From -100 to 100.
        tone : {"none", "neutral", "agx"}
            ``none`` clamps to 0..1.

        Raises
        ------
        InputError
            If there is no such curve, or the exposure is beyond these.
        """
        curve = tone_curve(tone)
        linear = np.asarray(self.radiance, dtype=np.float64) * exposure_scale(check_exposure(exposure))
        if self.alpha is None:
            return np.rint(linear_to_srgb(curve(linear)) * 255.0).astype(np.uint8)
        alpha = np.maximum(self.alpha, np.minimum(linear.max(axis=-1), 1.0))[..., None]
        color = linear_to_srgb(curve(np.divide(linear, alpha, out=np.zeros_like(linear), where=alpha > 0)))
        return np.rint(np.concatenate([color, alpha], axis=-1) * 255.0).astype(np.uint8)

    def save(self, path: str | Path, exposure: float = 0.0, tone: str = "none") -> None:
        """Write the frame: ``.png`` (sRGB picture), ``.exr`` (float picture and quantities) or ``.npz`` (all arrays).

        The file appears complete or not at all.

        Parameters
        ----------
        path : str or Path
        exposure : float
            Stops that a ``.png`` is brighter; the other files hold what was rendered.
        tone : {"none", "neutral", "agx"}
            Tone curve of a ``.png``: clamped to 0..1, Khronos PBR Neutral, or AgX.

        Raises
        ------
        InputError
            If the suffix is none of these, or there is no such tone curve.
        RenderError
            If the file cannot be written, or ``.exr`` is asked for without the OpenEXR package.
        """
        path = Path(path)
        check_output(path)
        if path.suffix.lower() == ".png":
            write_atomically(path, partial(write_png, pixels=self.to_srgb8(exposure, tone)))
        else:
            write_atomically(path, self._write_exr if path.suffix.lower() == ".exr" else self._write_npz)

    def save_aovs(self, folder: str | Path, truth: Frame | None = None) -> list[Path]:
        """Write the quantities as pictures to look at, into a folder that is made if need be.

        ``thickness.png`` in false colors with a scale, ``transmittance.png`` (sRGB-encoded), and ``validity.png`` with
        counts; ``normals.png`` of bodies with borders; and ``error.png``, by how much the thickness is off, where there
        is a `truth` of the same size, such as the reference's. For numbers, `save` an ``.exr`` or ``.npz``.

        Returns
        -------
        list of Path
            The files.

        Raises
        ------
        InputError
            If the folder is a file.
        RenderError
            If they cannot be written.
        """
        from translucent.frames.aovs import aov_pictures

        folder = Path(folder)
        make_folder(folder)
        files = []
        for name, pixels in aov_pictures(self, truth).items():
            files.append(folder / f"{name}.png")
            write_atomically(files[-1], partial(write_png, pixels=pixels))
        return files

    def _write_npz(self, path: Path) -> None:
        with path.open("wb") as stream:
            arrays = {name: getattr(self, name) for name in (*ARRAYS, *LAYER_ARRAYS, *MATTE_ARRAYS)}
            arrays = {name: array for name, array in arrays.items() if array is not None}
            np.savez_compressed(stream, allow_pickle=False, **arrays)

    def _write_exr(self, path: Path) -> None:
        import OpenEXR

        channels = {"RGB": np.ascontiguousarray(self.radiance, dtype=np.float32)}
        if self.normals is not None:
            for i, channel in enumerate("XYZ"):
                channels[f"normals.{channel}"] = np.ascontiguousarray(self.normals[..., i], dtype=np.float32)
        if self.alpha is not None:
            del channels["RGB"]
            channels["RGBA"] = np.concatenate([self.radiance, self.alpha[..., None]], axis=-1).astype(np.float32)
        for name, layer in (("transmittance", self.transmittance), ("optical_depth", self.optical_depth)):
            for i, channel in enumerate("RGB"):
                channels[f"{name}.{channel}"] = np.ascontiguousarray(layer[..., i], dtype=np.float32)
        channels["thickness.Z"] = np.ascontiguousarray(self.thickness, dtype=np.float32)
        for name in ("coverage", "valid"):
            channels[f"{name}.A"] = getattr(self, name).astype(np.float32)
        header = {
            "compression": OpenEXR.ZIP_COMPRESSION,
            "type": OpenEXR.scanlineimage,
            "comments": "linear Rec.709; thickness in metres",
        }
        try:
            with OpenEXR.File(header, channels) as file:
                file.write(str(path))
        except RuntimeError as error:  # what a full disk is to OpenEXR
            raise OSError(str(error)) from error

    def _repr_png_(self) -> bytes:
        """The picture, for notebooks."""
        import io

        stream = io.BytesIO()
        write_png(stream, self.to_srgb8())
        return stream.getvalue()


def write_png(file: Path | BinaryIO, pixels: npt.NDArray[np.uint8]) -> None:
    """Write 8-bit pixels (h, w, 3), (h, w, 4) with alpha, or (h, w) as they are."""
    from PIL import Image

    Image.fromarray(pixels).save(file, format="PNG")


def check_exposure(stops: float) -> float:
    """The exposure, if it is one.

    Raises
    ------
    InputError
        If it is not within 100 stops.
    """
    if not abs(stops) <= MAX_EXPOSURE:
        raise InputError(f"exposure {stops}", f"not within {MAX_EXPOSURE:g} stops", "give for example 1.5")
    return stops


def make_folder(folder: Path) -> None:
    """Make a folder, and those above it, unless it is there.

    Raises
    ------
    InputError
        If its name, or that of a folder above, is one of a file.
    RenderError
        If it cannot be made.
    """
    require_folder(folder, f"folder {str(folder)!r}")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RenderError(
            f"folder {str(folder)!r}", f"it cannot be made ({error.strerror})", "check the path"
        ) from error


def check_output(path: Path) -> None:
    """Raise before any work is done where a frame could not be written to `path`."""
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"output {str(path)!r}", f"suffix {path.suffix!r}", "use .png, .exr or .npz")
    require_place(path, f"output {str(path)!r}")
    if path.suffix.lower() == ".exr":
        require_package("OpenEXR", f"output {str(path)!r}")
