"""WGSL run by wgpu: functions over arrays, and signed depth drawn and resolved."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.hosts import Host
from tests.probe import Signature

_WIDTH = {"float": 1, "vec2": 2, "vec3": 3, "vec4": 4}
_KIND = {1: "f32", 2: "vec2<f32>", 3: "vec3<f32>", 4: "vec4<f32>"}


def run_function(device: Any, library: str, signature: Signature, arguments: list[np.ndarray]) -> np.ndarray:
    """Evaluate a function of a library in WGSL over arrays, as `tests.probe.run_function` does in GLSL."""
    import wgpu

    count = len(arguments[0])
    kind, _, length = signature.returns.rstrip("]").partition("[")
    width = _WIDTH[kind]
    total = width * int(length or 1)
    code = [library, "@group(0) @binding(0) var<storage, read_write> result: array<f32>;"]
    passed = []
    for k, (kind, _, many) in enumerate(signature.parameters, 1):
        code.append(f"@group(0) @binding({k}) var<storage, read> given_{k}: array<f32>;")
        values = [_value(f"given_{k}", _WIDTH[kind], many or 1, j) for j in range(many or 1)]
        passed.append(f"array<{_KIND[_WIDTH[kind]]}, {many}>({', '.join(values)})" if many else values[0])
    parts = [f"found[{i}]" for i in range(total)] if total > 1 else ["found"]
    stores = "\n".join(f"    result[{total}u * i + {k}u] = {part};" for k, part in enumerate(parts))
    code.append(
        "@compute @workgroup_size(64) fn probe(@builtin(global_invocation_id) id: vec3<u32>) {\n"
        f"    let i = id.x;\n    if (i >= {count}u) {{ return; }}\n"
        f"    let found = {signature.name}({', '.join(passed)});\n{stores}\n}}"
    )
    layout = "auto"
    module = device.create_shader_module(code="\n".join(code))
    pipeline = device.create_compute_pipeline(layout=layout, compute={"module": module, "entry_point": "probe"})
    storage = wgpu.BufferUsage.STORAGE
    output = device.create_buffer(size=4 * count * total, usage=storage | wgpu.BufferUsage.COPY_SRC)
    given = [device.create_buffer_with_data(data=np.float32(a).tobytes(), usage=storage) for a in arguments]
    entries = [{"binding": k, "resource": {"buffer": buffer}} for k, buffer in enumerate([output, *given])]
    encoder = device.create_command_encoder()
    work = encoder.begin_compute_pass()
    work.set_pipeline(pipeline)
    work.set_bind_group(0, device.create_bind_group(layout=pipeline.get_bind_group_layout(0), entries=entries))
    work.dispatch_workgroups(-(-count // 64))
    work.end()
    device.queue.submit([encoder.finish()])
    found = np.frombuffer(device.queue.read_buffer(output), np.float32)
    return found if total == 1 else found.reshape(count, total)


def _value(name: str, width: int, many: int, j: int) -> str:
    parts = ", ".join(f"{name}[{width * many}u * i + {width * j + k}u]" for k in range(width))
    return f"{_KIND[width]}({parts})" if width > 1 else parts


#: Formats of what resolves write: thickness and flags are apart, or with the count in one.
APART = ("rgba8unorm", "rgba8unorm", "rgba8unorm", "r32float", "r8unorm")
TOGETHER = ("rgba32float",)
_NUMBERS = {"rgba8unorm": (np.uint8, 4), "r8unorm": (np.uint8, 1), "r32float": (np.float32, 1)}
_NUMBERS["rgba32float"] = (np.float32, 4)


def draw(
    device: Any, host: Host, stages: dict[str, str], outputs: tuple[str, ...], *, upside_down: bool
) -> list[np.ndarray]:
    """Outputs of the WGSL stages ``body``, ``sum``, ``full`` and ``resolve``, of these formats.

    Upside down, the first row of the sums is the lowest of the picture, which turns faces around.
    """
    import wgpu

    modules = {name: device.create_shader_module(code=text) for name, text in stages.items()}
    usage = wgpu.TextureUsage.RENDER_ATTACHMENT | wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.COPY_SRC
    texture = lambda kind: device.create_texture(size=(*host.size, 1), format=kind, usage=usage)  # noqa: E731
    sums = texture("rg32float")
    # The sum of all faces, in any order.
    add = {"operation": "add", "src_factor": "one", "dst_factor": "one"}
    attributes = [{"format": "float32x3", "offset": 0, "shader_location": 0}]
    drawn = device.create_render_pipeline(
        layout="auto",
        vertex={"module": modules["body"], "buffers": [{"array_stride": 12, "attributes": attributes}]},
        primitive={"topology": "triangle-list", "front_face": "cw" if upside_down else "ccw"},
        fragment={
            "module": modules["sum"],
            "targets": [{"format": "rg32float", "blend": {"color": add, "alpha": add}}],
        },
    )
    resolved = device.create_render_pipeline(
        layout="auto",
        vertex={"module": modules["full"]},
        primitive={"topology": "triangle-list"},
        fragment={"module": modules["resolve"], "targets": [{"format": kind} for kind in outputs]},
    )
    targets = [texture(kind) for kind in outputs]

    def buffer(data: bytes, kind: int) -> dict[str, Any]:
        return device.create_buffer_with_data(data=data, usage=kind)

    def bound(pipeline: Any, resources: dict[int, Any]) -> Any:
        entries = [{"binding": k, "resource": resource} for k, resource in resources.items()]
        return device.create_bind_group(layout=pipeline.get_bind_group_layout(0), entries=entries)

    def target(view: Any) -> dict[str, Any]:
        return {"view": view.create_view(), "load_op": "clear", "store_op": "store", "clear_value": (0, 0, 0, 0)}

    def block(name: str) -> dict[str, Any]:
        return {"buffer": buffer(host.by_columns(name, upside_down=upside_down), wgpu.BufferUsage.UNIFORM)}

    encoder = device.create_command_encoder()
    work = encoder.begin_render_pass(color_attachments=[target(sums)])
    work.set_pipeline(drawn)
    work.set_vertex_buffer(0, buffer(host.offsets.tobytes(), wgpu.BufferUsage.VERTEX))
    work.set_index_buffer(buffer(host.faces.tobytes(), wgpu.BufferUsage.INDEX), "uint32")
    work.set_bind_group(0, bound(drawn, {1: block("Body")}))
    work.draw_indexed(host.faces.size)
    work.end()
    work = encoder.begin_render_pass(color_attachments=[target(one) for one in targets])
    work.set_pipeline(resolved)
    blocks = {0: block("View"), 2: block("Shade"), 16: sums.create_view()}
    if "seen_kind" in stages["full"]:
        blocks[5] = block("Environment")
    work.set_bind_group(0, bound(resolved, blocks))
    work.draw(3)
    work.end()
    device.queue.submit([encoder.finish()])
    return [_read(device, one, *_NUMBERS[kind]) for one, kind in zip(targets, outputs, strict=True)]


def _read(device: Any, texture: Any, kind: type, channels: int) -> np.ndarray:
    width, height, _ = texture.size
    layout = {"bytes_per_row": width * channels * np.dtype(kind).itemsize, "rows_per_image": height}
    data = device.queue.read_texture({"texture": texture}, layout, texture.size)
    return np.frombuffer(data, kind).reshape(height, width, channels)
