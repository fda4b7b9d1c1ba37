"""Result of a rendering: radiance, thickness, coverage and validity of each pixel, with the plan that made them."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from translucent.arguments import brief, checked
from translucent.errors import InputError
from translucent.formulas.color import exposure_scale, linear_to_srgb
from translucent.formulas.tone import tone_curve
from translucent.frames.writing import Bundle, frame_bundle, png, write_frame, write_pictures
from translucent.planning.render_plan import RenderPlan
from translucent.scene.scene import Scene


class Deferred:
    """Array that is computed when it is first read.

    Parameters
    ----------
    make : callable
        Of the arguments.
    arguments
        Read-only arrays and numbers.
    """

    def __init__(self, make: Callable[..., npt.NDArray[Any]], *arguments: object) -> None:
        self._make, self._arguments = make, arguments

    def made(self) -> npt.NDArray[Any]:
        """The array, a new one at each call."""
        return self._make(*self._arguments)


def thickness_of(marked: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(h, w): thickness without its sign bit, which marks invalid pixels."""
    found: npt.NDArray[np.float32] = np.abs(marked)
    return found


def valid_of(marked: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
    """(h, w): whether the sign bit is clear."""
    return np.asarray(marked.view(np.int32) >= 0)


def coverage_of(marked: npt.NDArray[np.float32], floor: float) -> npt.NDArray[np.bool_]:
    """(h, w): whether there is a thickness above `floor`, or none that is valid."""
    return (marked > np.float32(floor)) | np.signbit(marked)


def optical_depth_of(marked: npt.NDArray[np.float32], extinction: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(h, w, 3): thickness times the extinction (3,) of the one medium."""
    thickness = thickness_of(marked)
    depth = np.empty((*thickness.shape, 3), dtype=np.float32)
    with np.errstate(under="ignore"):
        for channel, value in enumerate(extinction):
            np.multiply(thickness, value, out=depth[..., channel])
    return depth


def transmitted_of(marked: npt.NDArray[np.float32], extinction: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(h, w, 3): transmittance of thickness in one medium with this extinction (3,)."""
    thickness = thickness_of(marked)
    through, depth = np.empty((*thickness.shape, 3), dtype=np.float32), np.empty_like(thickness)
    with np.errstate(under="ignore"):
        for channel, value in enumerate(extinction):
            np.multiply(thickness, -value, out=depth)
            np.exp(depth, out=depth)
            through[..., channel] = depth
    return through


def transmittance_of(depth: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(h, w, 3): exp(-tau) of optical depths (Beer-Lambert)."""
    through = np.negative(depth)
    with np.errstate(under="ignore"):
        return np.asarray(np.exp(through, out=through))


def copied(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Copy of an array."""
    return values.copy()


#: The arrays of a frame, under the names that .npz files use.
ARRAYS = ("radiance", "transmittance", "optical_depth", "thickness", "coverage", "valid")

#: Additional arrays of frames of ordered methods.
LAYER_ARRAYS = ("layers", "truncated")

#: Additional arrays of frames without a background, and of bodies with interfaces.
MATTE_ARRAYS = ("alpha", "passed", "normals")

#: Additional array of frames of random paths.
NOISE_ARRAYS = ("standard_error",)

#: Where a frame keeps the arrays that nobody has read yet.
_DEFERRED = "_deferred"

#: Largest exposure in stops, beyond which radiance would overflow float64 or be black.
MAX_EXPOSURE = 100.0


@dataclass(frozen=True, eq=False)
class Frame:
    """A rendered picture with its physical quantities. Row 0 is the top row; arrays are contiguous and the caller's.

    Arrays that follow from others are computed when they are first read.

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
        Of a frame rendered without the environment behind: fraction of what is behind that it hides, the mean of the
        channels. The radiance is then that of the frame alone: an associated (premultiplied) color.
    passed : (h, w, 3) float, optional
        Of such a frame: fraction of what is behind that passes, by channel, so that ``radiance + passed * behind`` is
        the picture before anything, colored shadows on a shadow catcher included. 1 - alpha is its mean.
    normals : (h, w, 3) float, optional
        Unit normals, in world axes, of the interfaces where rays enter bodies; 0 where there is none. Only of frames
        whose plan has interfaces.
    standard_error : (h, w, 3) float, optional
        Of the radiance, where it is a mean over random paths; None where it has no noise.
    scene : Scene, optional
        Scene that was rendered, for `to_html`. None of frames before a backdrop, which is no part of it.
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
    passed: npt.NDArray[Any] | None = None
    normals: npt.NDArray[Any] | None = None
    standard_error: npt.NDArray[Any] | None = None
    scene: Scene | None = None

    def __post_init__(self) -> None:
        # Without their attribute, `__getattr__` finds them.
        deferred = {name: value for name, value in vars(self).items() if isinstance(value, Deferred)}
        for name in deferred:
            del self.__dict__[name]
        self.__dict__[_DEFERRED] = deferred

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> npt.NDArray[Any]:
            """An array that is made when it is first read."""
            if (deferred := self.__dict__.get(_DEFERRED, {}).get(name)) is None:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            return self.__dict__.setdefault(name, deferred.made())

    def __dir__(self) -> list[str]:
        """Attribute names, including arrays that are not computed yet."""
        return sorted({*super().__dir__(), *self.__dict__.get(_DEFERRED, {})})

    def rendered_from(self, scene: Scene, plan: RenderPlan) -> Frame:
        """The frame, as one of that scene, by this plan."""
        frame = copy.copy(self)
        frame.__dict__.update(scene=scene, plan=plan)
        return frame

    def __repr__(self) -> str:
        covered, invalid = int(self.coverage.sum()), int((~self.valid).sum())
        return f"Frame({self.size[0]}x{self.size[1]}, {covered} pixels covered, {invalid} invalid)"

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.thickness.shape[1], self.thickness.shape[0]

    @property
    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The arrays that the frame has, by name."""
        every = {name: getattr(self, name) for name in (*ARRAYS, *LAYER_ARRAYS, *MATTE_ARRAYS, *NOISE_ARRAYS)}
        return {name: array for name, array in every.items() if array is not None}

    def summary(self) -> dict[str, Any]:
        """Statistics of the frame as values that JSON can hold; thickness in metres over the valid, covered pixels."""
        visible = self.thickness[self.coverage & self.valid]
        found: dict[str, Any] = {
            "size": list(self.size),
            "plan": self.plan.summary(),
            "seconds": dict(self.seconds),
            "provenance": dict(self.provenance),
            "covered_pixels": int(self.coverage.sum()),
            "invalid_pixels": int((~self.valid).sum()),
            "thickness": {"median": float(np.median(visible)), "max": float(visible.max())} if visible.size else None,
        }
        if self.layers is not None and self.truncated is not None:
            found["layers"] = {"max": int(self.layers.max()), "truncated_pixels": int((self.truncated > 0).sum())}
        return found

    @checked
    def to_srgb8(self, exposure: float = 0.0, tone: str = "none") -> npt.NDArray[np.uint8]:
        """(h, w, 3) uint8: radiance, `exposure` stops brighter, through a tone curve and sRGB-encoded.

        A frame with `alpha` gives (h, w, 4) with colors that are not multiplied by it, as PNG has them, for programs
        that mix encoded colors, as browsers do. One alpha cannot tint what is behind: before white the picture is
        right, with the colors of glass and of shadows; before black it is where nothing tints, and a tint shines
        elsewhere.

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
        passed = self.alpha[..., None] * -1.0 + 1.0 if self.passed is None else self.passed
        # The same before a black and a white page (Smith & Blinn 1996); pages are white as they are.
        own = curve(linear)
        before_black, before_white = linear_to_srgb(own), linear_to_srgb(np.minimum(own + passed, 1.0))
        alpha = 1.0 - (before_white - before_black).min(axis=-1, keepdims=True)
        mixed = before_white - (1.0 - alpha)
        color = np.divide(mixed, alpha, out=np.zeros_like(mixed), where=alpha > 0)
        return np.rint(np.concatenate([np.clip(color, 0.0, 1.0), alpha], axis=-1) * 255.0).astype(np.uint8)

    @checked
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
            If the file cannot be written, or ``.exr`` is requested without the OpenEXR package.
        """
        write_frame(Path(path), self.arrays, partial(self.to_srgb8, exposure, tone))

    @checked
    def save_aovs(self, folder: str | Path, truth: Frame | None = None) -> list[Path]:
        """Write the quantities as pictures to look at, into a folder that is made if need be.

        ``thickness.png`` in false colors with a scale, ``transmittance.png`` (sRGB-encoded), and ``validity.png`` with
        counts; ``normals.png`` of bodies with interfaces; and ``error.png``, by how much the thickness is off, where
        there is a `truth` of the same size, such as the reference's. For numbers, `save` an ``.exr`` or ``.npz``.

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
        from translucent.frames.aovs import aov_pictures  # it loads Pillow

        pictures = aov_pictures(self.arrays, None if truth is None else truth.arrays)
        return write_pictures(Path(folder), pictures.items())

    @checked
    def to_html(self, exposure: float = 0.0, tone: str = "neutral", *, name: str | None = None) -> str:
        """Text of a page that shows the frame's scene in any browser with WebGL2, as `write_page` writes it.

        The view begins as the frame is seen, by the choices that it was rendered with; the frame's picture is there
        until the scene is, unless it has an `alpha`: what is behind is always seen on a page.

        Parameters
        ----------
        exposure : float
            Stops brighter.
        tone : {"none", "neutral", "agx"}
            Tone curve.
        name : str, optional
            Title of the page. Default: the name of the first body.

        Raises
        ------
        InputError
            If the frame has no scene, or WebGL2 cannot draw it by these choices.
        """
        # By name: a frame is a value, and knows of no pages.
        text: str = import_module("translucent.page.write").frame_html(self, exposure, tone, name)
        return text

    def _repr_mimebundle_(self, **_: Any) -> Bundle:
        """The picture, and thickness with a scale, for notebooks."""
        return frame_bundle(self.to_srgb8(), self.arrays, str(self.plan).partition("\n")[0], repr(self))

    def _repr_html_(self) -> str:
        """HTML of the frame for notebooks without rich bundles."""
        return str(self._repr_mimebundle_()[0]["text/html"])

    def _repr_png_(self) -> bytes:
        """The picture alone."""
        return png(self.to_srgb8())


def check_exposure(stops: float) -> float:
    """Check an exposure; raises `InputError` if it is out of range.

    Raises
    ------
    InputError
        If it is not a number within 100 stops.
    """
    try:
        within = bool(-MAX_EXPOSURE <= stops <= MAX_EXPOSURE)
    except (TypeError, ValueError):  # texts, arrays, complex numbers
        raise InputError(
            f"exposure {brief(stops)}", "the exposure is not a number", "give the exposure in stops, for example 1.5"
        ) from None
    if not within:
        raise InputError(
            f"exposure {stops}", f"the exposure must lie within {MAX_EXPOSURE:g} stops", "use a value such as 1.5"
        )
    return stops
