"""Pictures for tests that only ask whether they are made: what takes time and changes nothing of that is little."""

from __future__ import annotations

import pytest

from translucent.planning.shadow_maps import ShadowMaps
from translucent.scene import staging


def with_few_shadows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make maps of shadows of 128 texels a side, where no size is stated, and of 8 directions on stages."""
    monkeypatch.setattr(ShadowMaps.__init__, "__defaults__", (128, None))
    monkeypatch.setattr(staging, "ENVIRONMENT_SHADOWS", 8)
