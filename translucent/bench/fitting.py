"""Fit of the thickness that a shortcut assumes, by least squared error."""

from __future__ import annotations

import dataclasses

import numpy as np

from translucent.bench.contenders import Contender
from translucent.bench.drawing import Size, Studio
from translucent.bench.scattering.shot import shot_of
from translucent.bench.staging import drawing, plan_of
from translucent.frames.frame import Frame
from translucent.gpu.targets import Targets
from translucent.planning.methods import ThinLayer
from translucent.scene.scene import Scene


def fitted(studio: Studio, contender: Contender, scene: Scene, truth: Frame, size: Size) -> tuple[Contender, float]:
    """Contender with the thickness of least squared error, and that thickness in metres; of an engine, its settings.

    Thickness is proportional to what is assumed, so one picture tells: with t for 1 m, the best is <t d> / <t t> over
    all pixels that truth or picture cover.
    """
    if contender.engine is not None:
        shot = shot_of(studio.renderer, scene, size)
        return dataclasses.replace(contender, engine=contender.engine.fitted(shot, truth.radiance)), 0.0
    told = contender.technique == "plan" and all(body.sheet_thickness is not None for body in scene.bodies)
    if told or not contender.fitted:
        return contender, 0.0
    probe = float(scene.diagonal)
    contender = dataclasses.replace(contender, method=ThinLayer(probe))
    targets = Targets(studio.gl, size)
    try:
        drawn = drawing(studio, contender, scene, plan_of(studio, contender, scene), targets, probe, None)
        try:
            drawn.draw()
            frame = drawn.read()
        finally:
            drawn.release()
    finally:
        targets.release()
    used = truth.valid & (truth.coverage | frame.coverage)
    shape = np.asarray(frame.thickness, np.float64)[used] / probe
    best = float(np.sum(shape * truth.thickness[used]) / max(np.sum(shape**2), np.finfo(np.float64).tiny))
    return dataclasses.replace(contender, method=ThinLayer(best)), best
