"""Stored truth of the benchmark's scenes: two independent halves, thickness, and how far renderers agree on it."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter

from translucent.arrays import Array, Mask
from translucent.bench.truth import require_same_scene
from translucent.benchmark.scenes import BenchmarkScene
from translucent.errors import InputError
from translucent.files.images import read_exr, write_exr
from translucent.files.paths import write_atomically

#: Relative and absolute difference of parameters up to which a scene is the one whose truth is stored: rounding.
SAME, SAME_ZERO = 1e-5, 1e-8

#: Standard errors within which two renderers agree on a pixel, and the fraction of pixels that must agree.
AGREEMENT, AGREEING = 4.0, 0.97

#: What makes it anew.
DO = "run tools/benchmark_truth.py"


@dataclass(frozen=True)
class TruthPicture:
    """Truth of one scene.

    Attributes
    ----------
    halves : (2, h, w, 3) float32
        Linear radiance, two estimates with independent noise; each pixel is a mean over its square.
    mask : (h, w) bool
        Pixels that show something of the scene, not only its surroundings: the ones to be judged.
    thickness : (h, w) float32, optional
        Metres in media along straight rays through the centers of pixels; NaN where it is not defined, and beside
        silhouettes, where renderers may differ on what a center sees.
    parameters : (n,) float64
        Of the scene (`scene_parameters`).
    paths : int
        Of each pixel, in both halves together.
    """

    halves: Array
    mask: Mask
    thickness: Array | None
    parameters: Array
    paths: int

    @property
    def radiance(self) -> Array:
        """(h, w, 3) float64: mean of the halves."""
        return np.asarray(self.halves.astype(np.float64).mean(axis=0))

    @property
    def noise(self) -> float:
        """Standard error of the pixels of one half, root mean square, as a fraction of the mean radiance."""
        one, other = self.halves.astype(np.float64)[:, self.mask]
        return float(np.sqrt(((one - other) ** 2).mean() / 2) / max(self.radiance[self.mask].mean(), 1e-12))

    def write(self, path: Path) -> None:
        """Write an OpenEXR file: layers a and b in half precision, mask, thickness in float32."""
        names = ("R", "G", "B")
        channels: dict[str, Any] = {
            f"{layer}.{name}": half[..., i].astype(np.float16)
            for layer, half in zip("ab", self.halves, strict=True)
            for i, name in enumerate(names)
        }
        channels["mask"] = self.mask.astype(np.float16)
        if self.thickness is not None:
            channels["thickness"] = self.thickness.astype(np.float32)
        record = json.dumps({"parameters": self.parameters.tolist(), "paths": self.paths})
        write_atomically(path, lambda part: write_exr(part, channels, {"translucent": record}))

    @classmethod
    def read(cls, path: Path) -> TruthPicture:
        """Truth of a file; raises `InputError` where it is not one."""
        header, channels = read_exr(path, f"truth {path.stem!r}")
        halves = np.stack([np.stack([channels[f"{layer}.{c}"] for c in "RGB"], axis=-1) for layer in "ab"])
        record = json.loads(header["translucent"])
        thickness = channels.get("thickness")
        parameters = np.array(record["parameters"])
        return cls(halves.astype(np.float32), channels["mask"] > 0.5, thickness, parameters, int(record["paths"]))


def truth_path(name: str) -> Path:
    """Path of the stored truth of a scene."""
    return Path(str(files("translucent.benchmark").joinpath("truth", f"{name}.exr")))


@cache
def stored_truth_of(scene: BenchmarkScene) -> TruthPicture:
    """Stored truth of a scene.

    Raises
    ------
    InputError
        If none is stored, or the scene has changed since.
    """
    path = truth_path(scene.name)
    if not path.is_file():
        raise InputError(f"truth of {scene.name!r}", "no true picture of this scene is stored", DO)
    truth = TruthPicture.read(path)
    require_same_scene(scene.name, scene.make(), truth.parameters, DO, SAME, SAME_ZERO)
    return truth


@dataclass(frozen=True)
class TruthAgreement:
    """Agreement of another renderer with the stored truth of a scene.

    Attributes
    ----------
    renderer : str
        With its version.
    paths : int
        Of each pixel; 0: it cannot render the scene.
    within : float
        Fraction of pixels within `AGREEMENT` standard errors.
    bias : float
        Mean difference from the truth, as a fraction of its mean.
    noise : float
        Standard error of its pixels, as a fraction of the mean.
    explained : str
        Why it differs, or why it cannot render the scene.
    """

    renderer: str
    paths: int
    within: float = float("nan")
    bias: float = float("nan")
    noise: float = float("nan")
    explained: str = ""

    @property
    def agrees(self) -> bool:
        """True if enough pixels agree."""
        return self.within >= AGREEING


def agreement_with(
    name: str, paths: int, truth: tuple[Array, Array], other: tuple[Array, Array], explained: str = ""
) -> TruthAgreement:
    """Agreement of two pictures, each radiance (h, w, 3) and its standard error, by a z-test of each pixel.

    Variances are means over 3 by 3 pixels, since those of single pixels are estimated from few paths. What half
    precision rounds off counts as an error of a thousandth.
    """
    (one, error), (two, other_error) = truth, other
    with np.errstate(under="ignore"):
        variance = uniform_filter(error**2 + other_error**2, size=(3, 3, 0), mode="nearest")
        z = (two - one) / np.sqrt(variance + (1e-3 * (np.abs(one) + one.mean())) ** 2)
        noise = np.sqrt((other_error**2).mean()) / one.mean()
    within = float((np.abs(z) <= AGREEMENT).all(axis=-1).mean())
    return TruthAgreement(name, paths, within, float(two.mean() / one.mean() - 1), float(noise), explained)


@dataclass(frozen=True)
class TruthRecord:
    """Metadata of the stored truth of a scene: noise, number of paths, agreement with other renderers.

    Attributes
    ----------
    paths : int
        Of each pixel, in both halves together.
    noise : float
        Of one half (`TruthPicture.noise`).
    seconds : float
        Processor time of both halves.
    agreements : tuple of TruthAgreement
    """

    paths: int
    noise: float
    seconds: float
    agreements: tuple[TruthAgreement, ...] = field(default=())


def read_records() -> dict[str, TruthRecord]:
    """Records of all stored truths, by scene."""
    path = truth_path("x").with_name("agreement.json")
    if not path.is_file():
        return {}

    def agreement(stored: dict[str, Any]) -> TruthAgreement:
        known: dict[str, Any] = {key: float("nan") if value is None else value for key, value in stored.items()}
        return TruthAgreement(**known)

    found = json.loads(path.read_text(encoding="utf-8"))
    return {
        name: TruthRecord(**{**one, "agreements": tuple(agreement(each) for each in one["agreements"])})
        for name, one in found.items()
    }
