"""Passes, one technique per file, and the table that maps a plan's pass names to them."""

from __future__ import annotations

from typing import Protocol

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.passes.caustics import CausticsPass
from translucent.gpu.passes.depth_peeling import DepthPeelingPass
from translucent.gpu.passes.fragment_lists import FragmentListsPass, KBufferPass
from translucent.gpu.passes.interfaces import InterfacesPass, SurfacesPass
from translucent.gpu.passes.light_views import LightViewsPass
from translucent.gpu.passes.opaque import BackdropPass, LayersPass, OpaquePass
from translucent.gpu.passes.path_trace import PathTracePass
from translucent.gpu.passes.shadow_maps import ShadowMapsPass
from translucent.gpu.passes.thickness import BackFaceDepthPass, SignedDepthPass, ThinLayerPass
from translucent.gpu.passes.traced_interfaces import TracedInterfacesPass
from translucent.gpu.passes.transmittance import TransmittancePass
from translucent.planning.passes import PassName, PassSpec


class Pass(Protocol):
    """Protocol of a pass: one step of a plan. It compiles its shaders when made, and sets all state that it relies on
    when run.
    """

    def __init__(self, gl: moderngl.Context) -> None: ...

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Run the pass as `spec` says."""


PASSES: dict[PassName, type[Pass]] = {
    PassName.SIGNED_DEPTH: SignedDepthPass,
    PassName.SIGNED_DEPTH_FALLBACK: SignedDepthPass,
    PassName.UNLIT: SignedDepthPass,
    PassName.THIN_LAYER: ThinLayerPass,
    PassName.THIN_LAYER_FALLBACK: ThinLayerPass,
    PassName.BACK_FACE_DEPTH: BackFaceDepthPass,
    PassName.SHADOW_MAPS: ShadowMapsPass,
    PassName.OPAQUE: OpaquePass,
    PassName.BACKDROP: BackdropPass,
    PassName.CAUSTICS: CausticsPass,
    PassName.LIGHT_VIEWS: LightViewsPass,
    PassName.DEPTH_PEELING: DepthPeelingPass,
    PassName.FRAGMENT_LISTS: FragmentListsPass,
    PassName.K_BUFFER: KBufferPass,
    PassName.TRANSMITTANCE: TransmittancePass,
    PassName.INTERFACES: InterfacesPass,
    PassName.SURFACES: SurfacesPass,
    PassName.TRACED: TracedInterfacesPass,
    PassName.LAYERS: LayersPass,
    PassName.PATH_TRACE: PathTracePass,
}
