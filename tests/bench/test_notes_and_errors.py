"""Notes of plans against errors: what is off by more than a twentieth of the light is named, and how much it may be."""

from __future__ import annotations

import re

import numpy as np
import pytest

import translucent as tl
from translucent.bench.cases import CASES, Case
from translucent.bench.truth import CaseTruth, stored_truth

#: Error in a channel's mean, or in blocks of pixels, as a fraction of the mean, that no plan may keep to itself.
SILENT = 0.05

#: Scenes whose truth is light of all kinds.
SCENES = [case for case in CASES if case.effect == "all light"]


@pytest.mark.parametrize("one", SCENES, ids=lambda one: one.name)
def test_no_error_is_larger_than_the_notes_say(one: Case, renderer: tl.Renderer) -> None:
    """The largest percentage in the notes is that of what is left out."""
    scene, size = one.scene((0, 0)), (one.compared, one.compared)
    truth = CaseTruth.of_paths(scene, stored_truth(one.name, scene))
    frame = renderer.render(scene, size, shadows=tl.ShadowMaps(256))
    found = truth.light_errors(frame, None)
    assert found is not None
    off = max(found.block, *map(abs, found.bias))
    notes = [*frame.plan.limits, *frame.plan.unmodelled]
    told = max((float(number) / 100 for note in notes for number in re.findall(r"(\d+) %", note)), default=0.0)
    print(one.name, f"{off:.3f} off, {told:.2f} in notes", np.round(found.bias, 3))
    assert off < max(SILENT, told), notes


def test_notes_name_what_they_are_about() -> None:
    """A leaf, a glow, and opaque objects in bodies: each has its words, and no other."""
    words = {
        "thin leaf": "spikes and edges are",
        "neon": "light that the bodies emit and scatter is",
        "ball in soap": "the light around 'sphere' inside the bodies",
        "cubes in and behind glass": "'cube': up to 20 % too dark, without light that interfaces refract",
    }
    texts = {one.name: str(tl.plan(one.scene((0, 0)))) for one in SCENES}
    for name, word in words.items():
        assert word in texts[name]
    for name in ("fog ahead", "ice in a drink"):
        assert not any(word in texts[name] for word in words.values())
