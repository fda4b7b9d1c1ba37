"""Interleaved timing, with the error from the same run, and against a depth-only pass over the same geometry."""

from __future__ import annotations

import platform
import time
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from translucent import reference
from translucent.bench.cases import Case
from translucent.camera import check_size
from translucent.errors import TranslucentWarning
from translucent.gpu.passes.depth_only import DepthOnlyPass
from translucent.metrics import compare, interior
from translucent.renderer import Renderer
from translucent.scene import Scene
from translucent.showcase import showcase
from translucent.solids import Sphere
from translucent.thickness import Method, SignedDepth

Timings = dict[str, list[float]]


def measure(
    cases: Sequence[Case],
    methods: dict[str, Method],
    size: tuple[int, int] = (1024, 1024),
    seconds: float = 4.0,
    backend: str | None = None,
) -> dict[str, Any]:
    """Time and error of each method on each case.

    Parameters
    ----------
    cases, methods
    size : (width, height)
    seconds : float
        Time to spend on each case, a quarter of it for warming up.
    backend : str, optional

    Returns
    -------
    dict
        ``machine`` and ``rows``: JSON-ready. In a row, ``ms`` is the thickness part (the passes over geometry),
        ``frame_ms`` that and the shading; ``ratio`` and ``frame_ratio`` are the medians, over the rounds, of these to
        the depth-only pass of the same round. Errors are thickness errors as shares of the diagonal, on pixels whose
        3 x 3 neighbourhood has equal hit counts.
    """
    size = check_size(size)
    rows: list[dict[str, Any]] = []
    with Renderer(backend) as renderer:
        for case in cases:
            scene = showcase(case.mesh(), size=size)
            with renderer.gpu.context.current() as gl:
                timings = _interleaved(_workloads(renderer, scene, size, methods), gl.finish, seconds)
            truth = reference.render(scene, size)
            inside = interior(reference.hit_counts(scene, size))
            floor = np.array(timings["depth-only"])
            rows.append({"case": case.name, "method": "depth-only", **_statistics("ms", floor)})
            for name, method in methods.items():
                rows.append(
                    {
                        "case": case.name,
                        "triangles": len(scene.objects[0].mesh.faces),
                        "method": name,
                        "parameters": str(method),
                        "size": list(size),
                        **_statistics("ms", np.array(timings[f"{name}/thickness"]), floor),
                        **_statistics("frame_ms", np.array(timings[f"{name}/frame"]), floor),
                        **_errors(renderer, scene, size, method, truth, inside),
                    }
                )
        machine = {"platform": platform.platform(), "processors": _processors(), **renderer.provenance}
        host = host_overhead(renderer)
    return {"machine": machine, "host": host, "rows": rows}


def host_overhead(renderer: Renderer, frames: int = 200) -> dict[str, float]:
    """Milliseconds that `Renderer.render` takes at 64 x 64, and what of it is neither GPU work nor read-back.

    The same frame is rendered with `render`, and with only `run` and `read` on a job that is prepared beforehand, in
    turn; the difference of the medians is the host's part.
    """
    scene, size = showcase(Sphere().tessellate(64), size=(64, 64)), (64, 64)
    with renderer.gpu.context.current():
        job = renderer.gpu.prepare(scene, size, renderer.plan(scene))
        whole, device = [], []
        for _ in range(frames):
            begin = time.perf_counter()
            renderer.render(scene, size)
            middle = time.perf_counter()
            job.place((0.0, 0.0))
            bound = time.perf_counter()
            renderer.gpu.run(job)
            renderer.gpu.read(job)
            whole.append(middle - begin)
            device.append(time.perf_counter() - bound)
        job.release()
    render, gpu = float(np.median(whole)) * 1e3, float(np.median(device)) * 1e3
    return {"render_ms": render, "gpu_and_read_ms": gpu, "host_ms": render - gpu}


def _workloads(
    renderer: Renderer, scene: Scene, size: tuple[int, int], methods: dict[str, Method]
) -> dict[str, Callable[[], None]]:
    """What is timed, by name; each draws with its own uniforms, prepared beforehand."""
    gl = renderer.gpu.context.gl
    floor_job = renderer.gpu.prepare(scene, size, renderer.plan(scene, SignedDepth()))
    floor_pass = DepthOnlyPass(gl)

    def depth_only() -> None:
        floor_job.place((0.0, 0.0), with_depth=True)
        gl.viewport = (0, 0, *size)
        floor_pass.run(floor_job)

    workloads: dict[str, Callable[[], None]] = {"depth-only": depth_only}
    for name, method in methods.items():
        job = renderer.gpu.prepare(scene, size, renderer.plan(scene, method))

        def thickness(job: Any = job) -> None:
            job.place((0.0, 0.0))
            renderer.gpu.run(job, geometry_only=True)

        def frame(job: Any = job) -> None:
            job.place((0.0, 0.0))
            renderer.gpu.run(job)

        workloads[f"{name}/thickness"] = thickness
        workloads[f"{name}/frame"] = frame
    return workloads


def _interleaved(workloads: dict[str, Callable[[], None]], finish: Callable[[], None], seconds: float) -> Timings:
    """Wall-clock seconds, A B C A B C, until the time is up; a quarter of it, and at least two rounds, warm up."""
    timings: Timings = {name: [] for name in workloads}
    started = time.perf_counter()
    rounds = 0
    warm = 0
    while rounds < warm + 5 or time.perf_counter() - started < seconds:
        for name, work in workloads.items():
            finish()
            begin = time.perf_counter()
            work()
            finish()
            timings[name].append(time.perf_counter() - begin)
        rounds += 1
        if time.perf_counter() - started < seconds / 4 or rounds < 2:
            warm = rounds
    return {name: values[warm:] for name, values in timings.items()}


def _statistics(name: str, values: Any, floor: Any = None) -> dict[str, float]:
    low, median, high, p95 = np.quantile(values * 1e3, (0.25, 0.5, 0.75, 0.95))
    found = {name: float(median), f"{name}_p95": float(p95), f"{name}_iqr": float(high - low)}
    if floor is not None:
        found[name.replace("ms", "ratio")] = float(np.median(values / floor))
    return found


def _errors(
    renderer: Renderer, scene: Scene, size: tuple[int, int], method: Method, truth: Any, inside: Any
) -> dict[str, Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TranslucentWarning)
        frame = renderer.render(scene, size, method)
    errors = compare(frame, truth, mask=inside)
    found = {key: getattr(errors, key) / scene.diagonal for key in ("median", "p99", "p999", "max", "rms", "bias")}
    return {
        **found,
        "invalid": errors.invalid,
        "coverage_mismatch": errors.coverage_mismatch,
        "geometry_passes": frame.plan.geometry_passes,
        "gpu_ms": 1e3 * sum(s for key, s in frame.seconds.items() if key != "total"),
    }


def _processors() -> int:
    import os

    return os.cpu_count() or 1


def table(result: dict[str, Any]) -> str:
    """The result as aligned text."""
    machine = result["machine"]
    lines = [
        f"{machine['renderer']}, {machine['processors']} processors; errors as shares of the diagonal",
        f"{'case':<13}{'method':<30}{'ms':>8}{'p95':>8}{'ratio':>7}{'frame':>7}{'median':>10}{'p99.9':>10}{'invalid':>9}",
    ]
    for row in result["rows"]:
        line = f"{row['case']:<13}{row['method']:<30}{row['ms']:>8.2f}{row['ms_p95']:>8.2f}"
        if "ratio" in row:
            line += f"{row['ratio']:>7.2f}{row['frame_ratio']:>7.2f}{row['median']:>10.1e}{row['p999']:>10.1e}"
            line += f"{row['invalid']:>9.2%}"
        lines.append(line)
    host = result["host"]
    lines.append(
        f"render() at 64x64: {host['render_ms']:.2f} ms, {host['host_ms']:.2f} ms of it neither GPU nor read-back"
    )
    return "\n".join(lines)
