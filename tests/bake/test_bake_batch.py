"""Many assets: equal to one by one, skipped when done, and stopped by nothing - not even a killed worker."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import weakref
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import translucent as tl
from tests.bake.tasks import die_or_double, sleep_long
from tests.processes import PATIENCE, runs, until
from translucent.bake import batch
from translucent.bake import jobs as jobs_module
from translucent.bake.batch import bake_many, in_processes, run_job
from translucent.bake.jobs import bake_file, content_hash
from translucent.bake.record import read_record, sidecar_of

Job = dict[str, Any]
QUICK = {"size": 16, "rays": 4, "padding": 2}


class Serial(Executor):
    """Does each job at once, here."""

    def submit(self, task: Any, /, *arguments: Any, **named: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(task(*arguments, **named))
        return future


@pytest.fixture
def make_jobs(make_ball: Callable[..., trimesh.Trimesh], tmp_path: Path) -> Callable[..., list[Job]]:
    """Jobs for balls of different sizes, with UVs: as .obj files, or .glb, for which processes import less."""

    def _make(count: int, out: str = "maps", suffix: str = ".npy", kind: str = ".obj", **more: Any) -> list[Job]:
        (tmp_path / out).mkdir(exist_ok=True)
        made = []
        for i in range(count):
            model = tmp_path / f"ball{i:02d}{kind}"
            if not model.exists():
                make_ball(1, 0.1 * (i + 1)).export(model)
            output = tmp_path / out / f"{model.stem}{suffix}"
            made.append({"model": str(model), "output": str(output), "settings": QUICK, **more})
        return made

    return _make


def contents(folder: Path) -> dict[str, bytes]:
    """The files of a folder, but for records, which tell times."""
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.suffix != ".json"}


def whole(jobs: list[Job]) -> None:
    """Every output is there, is what its record says, and nothing else is beside it."""
    folder = Path(jobs[0]["output"]).parent
    expected = {Path(job["output"]).name for job in jobs}
    assert {path.name for path in folder.iterdir()} == expected | {f"{name}.json" for name in expected}
    for job in jobs:
        assert jobs_module.is_done(job, content_hash(job))


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_what_a_killed_process_left_is_removed(make_jobs: Any) -> None:
    (job,) = make_jobs(1)
    output = Path(job["output"])
    output.parent.mkdir(exist_ok=True)
    # One file is written, and another within: both are cut off.
    code = (
        "import os, signal, sys, pathlib; from translucent.files.paths import write_atomically\n"
        "one, other = map(pathlib.Path, sys.argv[1:])\n"
        "die = lambda path: os.kill(os.getpid(), signal.SIGKILL)\n"
        "write_atomically(one, lambda path: (path.touch(), write_atomically(other, die)))\n"
    )
    command = [sys.executable, "-c", code, output, sidecar_of(output)]
    assert subprocess.run(command, check=False).returncode == -signal.SIGKILL
    left = list(output.parent.iterdir())
    assert len(left) == 2
    assert all(path.name.startswith(".partial-") for path in left)
    (output.parent / ".partial-00000000-of.another").write_text("kept")
    bake_file(job)
    assert {path.name for path in output.parent.iterdir()} == {
        output.name,
        sidecar_of(output).name,
        ".partial-00000000-of.another",
    }


def test_a_job_of_a_batch_reads_its_model_for_the_hash_once(make_jobs: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    (job,) = make_jobs(1)
    asked: list[Job] = []

    def counted(job: Job) -> str:
        asked.append(job)
        return content_hash(job)

    for module in ("batch", "jobs"):
        monkeypatch.setattr(f"translucent.bake.{module}.content_hash", counted)
    assert run_job(job)["status"] == "baked"
    assert asked == [job]
    assert (read_record(Path(job["output"])) or {})["hash"] == content_hash(job)


def test_a_job_is_done_and_done_once(make_jobs: Any) -> None:
    (job,) = make_jobs(1)
    first = run_job(job)
    assert (first["status"], first["error"], first["unit"]) == ("baked", None, "m")
    assert 0 < first["range"]["min"] <= first["range"]["max"] <= 0.2
    whole([job])
    written = os.stat(job["output"]).st_mtime_ns
    assert run_job(job)["status"] == "skipped"
    assert run_job({**job, "threads": 2, "resume": False})["status"] in ("skipped", "baked")
    assert os.stat(job["output"]).st_mtime_ns >= written


def test_a_worker_of_another_version_bakes_nothing(make_jobs: Any) -> None:
    (job,) = make_jobs(1)
    entry = run_job(job, "0.0.0")
    assert entry["status"] == "failed"
    assert entry["error"] == f"the worker has version {tl.__version__}, and not 0.0.0; install 0.0.0 there"
    assert not Path(job["output"]).exists()
    assert run_job(job, tl.__version__)["status"] == "baked"


def test_results_that_are_told_are_let_go(make_jobs: Any) -> None:
    """Dask would make those of a lost worker again for whoever still holds them."""

    class Watched(Serial):
        def submit(self, task: Any, /, *arguments: Any, **named: Any) -> Future[Any]:
            future = super().submit(task, *arguments, **named)
            held.add(future)
            return future

    held: weakref.WeakSet[Future[Any]] = weakref.WeakSet()
    counts: list[int] = []
    bake_many(make_jobs(4), Watched(), progress=lambda _: counts.append(len(held)))
    assert counts == [4, 3, 2, 1]  # the one that is told, and those to come


FAULTS = """
import resource
import numpy as np
from translucent.bake.batch import reuse_freed_memory_if_fixed

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        np.ones(1 << 18)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

before = faults()
reuse_freed_memory_if_fixed()
faults()
print(before, faults())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="of glibc")
def test_arrays_reuse_memory_on_workers_of_dask() -> None:
    asked = {**os.environ, "MALLOC_TRIM_THRESHOLD_": "65536"}
    found = subprocess.run([sys.executable, "-c", FAULTS], env=asked, check=True, capture_output=True, text=True).stdout
    before, after = map(int, found.split())
    if before < 20:
        pytest.skip("this C library keeps memory whatever the variable says, or pages are huge")
    assert after < before / 10, found  # 20 arrays of 512 pages each


def test_a_mesh_that_was_inside_out_is_told(make_ball: Any, tmp_path: Path) -> None:
    ball = make_ball(1)
    ball.invert()
    ball.export(tmp_path / "inverted.obj")
    job = {"model": str(tmp_path / "inverted.obj"), "output": str(tmp_path / "t.npy"), "settings": QUICK}
    with pytest.warns(tl.TranslucentWarning, match="flipped"):
        report = bake_many([job], Serial())
    assert "; flipped 1 closed part outwards" in str(report)


@pytest.mark.parametrize("what", ["settings", "mesh", "output", "record", "medium", "version"])
def test_whatever_changes_is_baked_again(what: str, make_jobs: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    (job,) = make_jobs(1)
    assert run_job(job)["status"] == "baked"
    assert run_job(job)["status"] == "skipped"
    if what == "settings":
        job = {**job, "settings": {**QUICK, "seed": 1}}
    elif what == "mesh":
        with Path(job["model"]).open("a") as stream:
            stream.write("# one comment more\n")
    elif what == "output":
        Path(job["output"]).write_bytes(Path(job["output"]).read_bytes()[:-1])
    elif what == "record":
        sidecar_of(Path(job["output"])).write_text("{ cut")
    elif what == "medium":
        job = {**job, "medium": [1.0, 2.0, 3.0]}
    else:
        monkeypatch.setattr("translucent.bake.jobs.VERSION", "999")
    assert run_job(job)["status"] == "baked"
    assert run_job(job)["status"] == "skipped"


def test_the_files_that_a_gltf_links_to_count(ball_glb: Path, tmp_path: Path) -> None:
    from translucent.gltf.file import read_gltf

    file = read_gltf(ball_glb)
    (tmp_path / "data.bin").write_bytes(file.resource({}))
    file.tree["buffers"][0]["uri"] = "data.bin"
    (tmp_path / "ball.gltf").write_text(json.dumps(file.tree))
    job = {"model": str(tmp_path / "ball.gltf"), "output": str(tmp_path / "t.npy")}
    before = content_hash(job)
    assert content_hash(job) == before
    (tmp_path / "data.bin").write_bytes(b"\0" * len(file.resource({})))
    assert content_hash(job) != before


def test_a_batch_is_what_one_by_one_is(make_jobs: Any, tmp_path: Path) -> None:
    alone, together = (make_jobs(4, out, kind=".glb") for out in ("alone", "together"))
    for job in alone:
        bake_file(job)
    heard: list[str] = []
    report = bake_many(together, workers=2, progress=lambda entry: heard.append(entry["model"]))
    assert (report.count("baked"), report.count("failed")) == (4, 0)
    assert [asset["model"] for asset in report.assets] == [job["model"] for job in together]
    assert sorted(heard) == [job["model"] for job in together]
    assert contents(tmp_path / "alone") == contents(tmp_path / "together")
    whole(together)
    again = bake_many(together, Serial())
    assert again.count("skipped") == 4
    assert "0 baked, 0 suspect, 4 skipped, 0 failed" in str(again)
    json.dumps(report.summary(), allow_nan=False)


def test_a_bad_asset_stops_no_other(make_jobs: Any, tmp_path: Path) -> None:
    jobs = make_jobs(3)
    Path(jobs[1]["model"]).write_text("v 0 0 0\n")
    (tmp_path / "gone.obj").unlink(missing_ok=True)
    jobs.append({**jobs[0], "model": str(tmp_path / "gone.obj"), "output": str(tmp_path / "maps" / "gone.npy")})
    report = bake_many(jobs, Serial())
    assert [asset["status"] for asset in report.assets] == ["baked", "failed", "baked", "failed"]
    assert "the mesh has no faces" in report.assets[1]["error"] or "cannot be read" in report.assets[1]["error"]
    assert report.assets[3]["error"] == f"mesh {jobs[3]['model']!r}; no file has this path; check the path"
    assert "2 baked, 0 suspect, 0 skipped, 2 failed" in str(report)
    whole([jobs[0], jobs[2]])


def test_what_is_wrong_with_the_whole_batch_is_an_error(make_jobs: Any) -> None:
    jobs = make_jobs(2)
    with pytest.raises(tl.InputError, match="give each output a different name"):
        bake_many([jobs[0], {**jobs[1], "output": jobs[0]["output"].upper()}])
    with pytest.raises(tl.InputError, match="bake job with 'sice'; a bake job has no such key"):
        bake_many([{**jobs[0], "sice": 3}])
    with pytest.raises(tl.InputError, match="bake setting 'sise'; not a known setting"):
        bake_many([{**jobs[0], "settings": {"sise": 3}}])
    with pytest.raises(tl.InputError, match="bake job; the job has no key output"):
        bake_many([{"model": "a.obj"}])
    with pytest.raises(tl.InputError, match="0 worker processes; the number must be at least 1"):
        bake_many(jobs, workers=0)
    with pytest.raises(tl.InputError, match="max_distance '0%'; the value is not a percentage such as '10%'"):
        bake_many([{**jobs[0], "settings": {"max_distance": "0%"}}])
    with pytest.raises(tl.InputError, match="mode 'transmittance'; this mode needs a medium"):
        bake_many([{**jobs[0], "settings": {"mode": "transmittance"}}])
    assert not list(Path(jobs[0]["output"]).parent.iterdir())


def test_a_share_is_of_the_diagonal(make_jobs: Any) -> None:
    (job,) = make_jobs(1, settings={**QUICK, "max_distance": "10%"})
    record, results = bake_file(job)
    (result,) = results.values()
    assert record["settings"]["max_distance"] == pytest.approx(0.1 * result.mesh.diagonal)
    assert result.values.max() <= np.float32(0.1 * result.mesh.diagonal)


# Processes that die


def test_a_process_that_dies_takes_only_its_own_item_along() -> None:
    found = sorted(in_processes(die_or_double, list(range(5)), 2, lambda item: -item))
    assert found == [-3, 0, 2, 4, 8]


def test_processes_end_when_the_work_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """At once, and by themselves: also those that have just sent a result."""
    monkeypatch.setattr(batch, "PATIENCE", 45.0)
    before = set(multiprocessing.active_children())
    results = in_processes(sleep_long, [0, 1, 2], 2, lambda item: -item)
    assert next(results) == 0
    processes = set(multiprocessing.active_children()) - before
    assert processes
    results.close()  # what an exception such as Ctrl-C does to it
    assert not {process.exitcode for process in processes} & {None, -9}


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_processes_end_when_their_parent_is_killed(tmp_path: Path) -> None:
    code = (
        "import sys, time; from tests.bake.tasks import tell_and_hold\n"
        "from translucent.bake.batch import in_processes\n"
        "if __name__ == '__main__': list(in_processes(tell_and_hold, [0, 1], 2, lambda item: -item))\n"
    )
    (tmp_path / "batch.py").write_text(code)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, tmp_path / "batch.py"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
    ) as parent:
        assert parent.stdout is not None
        workers = [int(parent.stdout.readline()) for _ in range(2)]
        parent.kill()
    until(lambda: not any(map(runs, workers)))


# Dask


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed", reason="the package distributed is not installed")
    import logging

    from distributed import LocalCluster

    logging.getLogger("distributed").setLevel(logging.ERROR)
    assert distributed
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None, memory_limit=0) as made:
        yield made


@pytest.mark.filterwarnings("ignore")  # of Dask, about workers that end
def test_dask_bakes_all_though_its_worker_is_killed(cluster: Any, make_jobs: Any, tmp_path: Path) -> None:
    from distributed import Client

    jobs, alone = (make_jobs(12, out, ".exr", ".glb") for out in ("maps", "alone"))
    with Client(cluster) as client:
        (worker,) = client.run(os.getpid).values()

        def kill(entry: Job) -> None:
            done.append(entry)
            if len(done) == 5:
                os.kill(worker, signal.SIGKILL)

        done: list[Job] = []
        report = bake_many(jobs, client.get_executor(), progress=kill)
        client.wait_for_workers(1, timeout=PATIENCE)
    until(lambda: not runs(worker))
    # A job whose output was whole when its worker died is found done by the next one.
    assert len(report.assets) == 12
    assert {asset["status"] for asset in report.assets} <= {"baked", "skipped"}, str(report)
    # The client had heard of five; on a busy machine more were whole before the worker died.
    assert report.count("baked") >= 5
    whole(jobs)
    assert bake_many(alone, Serial()).count("baked") == 12
    # The same bytes, but for the files' own names, which nothing in them tells.
    assert contents(tmp_path / "maps") == contents(tmp_path / "alone")


def test_the_command_line_hands_jobs_to_dask(
    cluster: Any, make_jobs: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from translucent.cli import main

    models = [job["model"] for job in make_jobs(3)]
    options = ["--out-dir", str(tmp_path / "maps"), "--format", "npy", "--size", "16", "--rays", "4", "--json"]
    assert main(["bake", *models, *options, "--dask", cluster.scheduler_address]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["baked"], found["failed"]) == (3, 0)
    assert all(read_record(Path(asset["output"])) for asset in found["assets"])


def test_no_scheduler_is_a_plain_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("distributed", reason="the package distributed is not installed")
    from translucent.cli import main

    before = set(threading.enumerate())
    assert main(["bake", "bear", "--out-dir", str(tmp_path), "--dask", "not an address"]) == 1
    until(lambda: set(threading.enumerate()) <= before)  # no loop goes on
    assert capsys.readouterr().err.startswith("error: --dask not an address; no scheduler answered")


# Ctrl-C


#: The command line, which tells when its first rays are traced: then it is interrupted. Its strips are small: those
#: that have begun end soon, and all together take 20 seconds of a core, however late the interruption comes.
TELLING = """
import os
import signal
import sys
from translucent.bake import strips
from translucent.cli import main

bake = strips.Strips.bake
strips.STRIP_TEXELS = 1 << 11

def telling(*arguments):
    os.write(1, b"tracing\\n")  # in one piece: threads, and processes, share the pipe
    return bake(*arguments)

strips.Strips.bake = telling
if __name__ == "__main__":
    # A shell that runs tests in the background has its children ignore what Ctrl-C sends.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit(main())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals differ")
@pytest.mark.parametrize("many", [False, True])
def test_ctrl_c_leaves_nothing(many: bool, ball_glb: Path, tmp_path: Path) -> None:
    folder = tmp_path / "maps"
    folder.mkdir()
    where = ["--out-dir", str(folder)] if many else ["-o", str(folder / "ball.exr")]
    # Spawned processes run the script, too, but for its end.
    (tmp_path / "bake.py").write_text(TELLING)
    options = ["--rays", "1024", "--size", "512"]
    command = [sys.executable, str(tmp_path / "bake.py"), "bake", str(ball_glb), *where, *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            while (line := process.stdout.readline()) != "tracing\n":
                assert line, "it ends before it traces rays"
            process.send_signal(signal.SIGINT)
            _, error = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
    assert process.returncode == 130, error
    assert error.strip().splitlines()[-1] == "error: interrupted"
    assert not list(folder.iterdir())
