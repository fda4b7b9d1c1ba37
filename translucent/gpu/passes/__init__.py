"""One technique per file; the table maps a plan's pass names to them."""

from __future__ import annotations

from typing import Protocol

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.passes.back_face_depth import BackFaceDepthPass
from translucent.gpu.passes.backdrop import BackdropPass
from translucent.gpu.passes.depth_peeling import DepthPeelingPass
from translucent.gpu.passes.fragment_lists import FragmentListsPass
from translucent.gpu.passes.interfaces import InterfacesPass
from translucent.gpu.passes.k_buffer import KBufferPass
from translucent.gpu.passes.layers import LayersPass
from translucent.gpu.passes.light_views import LightViewsPass
from translucent.gpu.passes.opaque import OpaquePass
from translucent.gpu.passes.signed_depth import SignedDepthPass
from translucent.gpu.passes.surfaces import SurfacesPass
from translucent.gpu.passes.thin_layer import ThinLayerPass
from translucent.gpu.passes.transmittance import TransmittancePass
from translucent.planning.render_plan import PassSpec


class Pass(Protocol):
    """A step of a plan. It compiles its shaders when made, and sets all state that it relies on when run."""

    def __init__(self, gl: moderngl.Context) -> None: ...

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Do what `spec` says."""


PASSES: dict[str, type[Pass]] = {
    "signed_depth": SignedDepthPass,
    "signed_depth_fallback": SignedDepthPass,
    "unlit": SignedDepthPass,
    "thin_layer": ThinLayerPass,
    "thin_layer_fallback": ThinLayerPass,
    "back_face_depth": BackFaceDepthPass,
    "opaque": OpaquePass,
    "backdrop": BackdropPass,
    "light_views": LightViewsPass,
    "depth_peeling": DepthPeelingPass,
    "fragment_lists": FragmentListsPass,
    "k_buffer": KBufferPass,
    "transmittance": TransmittancePass,
    "interfaces": InterfacesPass,
    "surfaces": SurfacesPass,
    "layers": LayersPass,
}
