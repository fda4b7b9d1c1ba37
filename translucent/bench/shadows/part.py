"""The part of a report on shadows and caustics, step by step."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Iterable
from functools import partial
from typing import TypeVar

from translucent.bench.drawing import Studio
from translucent.bench.measure import one_line
from translucent.bench.record import Shadows
from translucent.bench.shadows import caustic_media, caustics, measure, scenes, sky
from translucent.errors import TranslucentWarning

Scene = TypeVar("Scene", scenes.ShadowScene, caustics.CausticScene)

#: Step of the part: what it adds to the record.
Step = Callable[[Shadows], Shadows]


class ShadowsRun:
    """Measurement of the part.

    Parameters
    ----------
    studio : Studio
    quick : bool
        Fewer scenes, and each in haste.
    """

    def __init__(self, studio: Studio, quick: bool) -> None:
        self._studio, self._quick = studio, quick

    def steps(self) -> dict[str, Step]:
        """The steps, by what progress says of them."""
        found: dict[str, Step] = {
            f"shadow, {one.name}": partial(self._case, one) for one in self._chosen(scenes.SCENES)
        }
        found["shadows of environments"] = self._sky
        found |= {f"caustic, {one.name}": partial(self._caustic, one) for one in self._chosen(caustics.SCENES)}
        media = () if self._quick else caustic_media.SCENES  # their truths take minutes
        return found | {f"caustic in a medium, {one.name}": partial(self._medium, one) for one in media}

    def _chosen(self, every: Iterable[Scene]) -> list[Scene]:
        return [one for one in every if one.quick or not self._quick]

    def _case(self, one: scenes.ShadowScene, made: Shadows) -> Shadows:
        found = measure.measure_shadow(self._studio, one, measure.QUICK if self._quick else measure.FULL)
        return dataclasses.replace(made, cases=(*made.cases, found))

    def _sky(self, made: Shadows) -> Shadows:
        try:
            rows = tuple(sky.measure_sky(self._studio.renderer, sky.QUICK if self._quick else sky.FULL))
        except Exception as error:  # noqa: BLE001 - the rest of the report goes on
            return dataclasses.replace(made, sky_failure=one_line(error))
        return dataclasses.replace(made, sky=rows)

    def _caustic(self, one: caustics.CausticScene, made: Shadows) -> Shadows:
        effort = caustics.QUICK if self._quick else caustics.FULL
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TranslucentWarning)
            found = caustics.measure_caustic(self._studio.renderer, one, effort)
        return dataclasses.replace(made, caustics=(*made.caustics, found))

    def _medium(self, one: caustic_media.MediumScene, made: Shadows) -> Shadows:
        found = caustic_media.measure_medium(self._studio.renderer, one, caustic_media.FULL)
        return dataclasses.replace(made, media=(*made.media, found))
