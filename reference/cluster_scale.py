"""What a cluster costs, measured on this machine, and a large job by simulation from these figures.

    python reference/cluster_scale.py -o reference/cluster_scale.json

Measured: the overhead of a task, in processor seconds of scheduler, client and worker, for results of several sizes;
the bytes that travel; one picture with two workers against one process; and processes that compile the same kernels at
once into one cache. The processes share two cores with whatever else runs, so costs are processor seconds.

Simulated: 1,000 frames of 3840 x 2160 pixels and 256 samples per pixel, frames as tasks, with 10, 100 and 1,000 workers
of 16 threads, and a network of 10 Gbit/s; of a scene that is quick, and of one with all effects. A worker takes samples
at the measured speed of a thread times 16. Frames differ in length (log-normal). The scheduler does one thing at a
time, and so does the client: it takes a frame from the network, and writes its files. `busy` is the share of the time
that each of them works. `limit` is the number of workers at which the client has as much to do as it can.
"""

import heapq
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit loads
import numpy as np
from machine import machine
from report import report_parser, write_report

from visray.cluster import connecting, local
from visray.cluster.frames import AHEAD
from visray.cluster.part import TARGET
from visray.cluster.scene_package import ScenePackage
from visray.pass_timer import PassTimer
from visray.passes import empty_film, exposed_once
from visray.scene.adjusted import adjusted
from visray.setup import set_threads

SCENES = Path(__file__).resolve().parents[1] / "scenes"
SPEEDS, TRIES = ("box.json", "everything.json"), 3
NAMES = ("box.json", "earth.json", "data-globe.json", "teapot.json")
FRAMES, PIXELS, SPP, THREADS, NETWORK = 1000, 3840 * 2160, 256, 16, 1.25e9
WORKERS, SPREAD = (10, 100, 1000), 0.2
TASKS, SIZES = 300, (1_000, 1_000_000, 10_000_000)
PROCESSES, ROUNDS = 4, 6


def processor_seconds(pid: int) -> float:
    """Processor seconds that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def result(package: ScenePackage, size: int) -> np.ndarray:
    """What a worker sends back for a task without work."""
    return np.zeros(size, np.uint8)


def overheads() -> list[dict]:
    """Costs of a task, by the size of its result."""
    with tempfile.TemporaryDirectory() as folder:
        address = "tcp://127.0.0.1:18799"
        scheduler = subprocess.Popen(
            [sys.executable, "-m", "dask", "scheduler", "--host", "127.0.0.1", "--port", "18799", "--no-dashboard"],
            stderr=subprocess.DEVNULL,
        )
        workers = [local._started(address, i, Path(folder)) for i in range(2)]
        try:
            with connecting.connected(address) as crew:
                crew.client.wait_for_workers(2)
                crew.send(ScenePackage.of(vr.Scene(camera=vr.Camera(), lights={})))
                return [task_cost(crew, size, scheduler.pid, workers[0].pid) for size in (SIZES[0], *SIZES)][1:]
        finally:
            for process in (*workers, scheduler):
                process.terminate()
                process.wait()


def task_cost(crew: "connecting.Crew", size: int, scheduler: int, worker: int) -> dict:
    """Costs of one task whose result has `size` bytes."""
    count = TASKS if size < SIZES[-1] else TASKS // 10
    pids = {"scheduler": scheduler, "client": os.getpid(), "worker": worker}
    before, begun, sent, done = {k: processor_seconds(p) for k, p in pids.items()}, time.perf_counter(), 0, 0
    while done < count:
        while sent < count and crew.has_room():
            crew.submit(sent, f"visray-nothing-{sent}", result, size)
            sent += 1
        done += len(crew.done())
    seconds = time.perf_counter() - begun
    cost = {f"{k}_seconds": (processor_seconds(p) - before[k]) / count for k, p in pids.items()}
    return {"bytes": size, "tasks": count, "elapsed_seconds": seconds / count} | cost


def packages() -> list[dict]:
    """Bytes of scenes, and seconds until a worker has prepared them."""
    rows = []
    for name in NAMES:
        package = ScenePackage.of(vr.load(SCENES / name))
        with tempfile.TemporaryDirectory() as folder:
            begun = time.process_time()
            vr.prepare(package.unpacked(Path(folder)))
            rows.append({"scene": name, "bytes": package.bytes, "unpacked_seconds": time.process_time() - begun})
    return rows


def one_picture() -> dict:
    """A picture with two workers against one process: seconds, and whether all bits are the same."""
    scene = adjusted(vr.load(SCENES / "box.json"), size=(960, 540), spp=64)
    seconds, images = {}, {}
    for key, cluster in (("one", None), ("local:2", "local:2")):
        begun = time.perf_counter()
        images[key] = vr.render(scene, cluster=cluster, progress=False)
        seconds[key] = time.perf_counter() - begun
    layers = images["one"].layers
    same = all(layers[name].tobytes() == images["local:2"][name].tobytes() for name in layers)
    return {"seconds": seconds, "same_bits": same}


def samples_per_second(name: str) -> float:
    """Samples that a thread takes in a second."""
    scene = adjusted(vr.load(SCENES / name), size=(192, 108), spp=64)
    set_threads(1)
    prepared = vr.prepare(scene)
    exposed_once(prepared, empty_film(prepared), 64)
    seconds = []
    for _ in range(TRIES):
        timer = PassTimer()
        exposed_once(prepared, empty_film(prepared), 64, timer)
        seconds.append(timer.sample_seconds)
    set_threads(local.cores())
    return 1 / min(seconds)


def sizes() -> dict:
    """Bytes and seconds per pixel of films and pictures."""
    prepared = vr.prepare(adjusted(vr.load(SCENES / "box.json"), size=(960, 540), spp=16))
    pixels, film = len(prepared.order), empty_film(prepared)
    found = {"film_bytes": sum(np.array(x).nbytes for x in film.moments.arrays) / pixels}
    found["block_bytes"] = sum(np.array(x).nbytes for x in film.moments.arrays[3:]) / pixels
    for suffix, layers in ((".png", ["RGB", "A"]), (".exr", None)):
        image = vr.render(prepared, progress=False, **({"layers": layers} if layers else {}))
        with tempfile.TemporaryDirectory() as folder:
            begun = time.process_time()
            image.write(Path(folder) / f"a{suffix}")
            found[suffix] = {
                "layer_bytes": sum(x.nbytes for x in image.layers.values()) / pixels,
                "write_seconds": (time.process_time() - begun) / pixels,
            }
    return found


def kernel_cache() -> dict:
    """Several processes compile the same kernels at once into one empty cache; then another one reads it."""
    script = (
        f"import visray as vr, hashlib; i = vr.render({str(SCENES / 'box.json')!r}, size=(16, 12), spp=2,"
        " progress=False); print(hashlib.sha256(i['RGB'].tobytes() + i['N'].tobytes()).hexdigest())"
    )
    pictures, files, failures = set(), set(), 0
    for _ in range(ROUNDS):
        with tempfile.TemporaryDirectory() as folder:
            processes = [with_cache(script, folder) for _ in range(PROCESSES)]
            done = [process.communicate() for process in processes]
            done.append(with_cache(script, folder).communicate())
            pictures |= {out for out, _ in done}
            failures += sum(bool(err) or not out for out, err in done)
            files.add(tuple(sorted((f.name, f.stat().st_size) for f in Path(folder).iterdir())))
    return {"rounds": ROUNDS, "processes": PROCESSES + 1, "pictures": len(pictures), "failures": failures,
            "kernels": len(next(iter(files))), "caches": len(files)}  # fmt: skip


def with_cache(script: str, folder: str) -> subprocess.Popen:
    """A process that runs a script, and keeps kernels in a folder."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, "-c", script], env=os.environ | {"DRJIT_CACHE_DIR": folder}, **pipes)


@dataclass
class Job:
    """A job of frames.

    seconds: seconds of each frame on a worker
    scheduler, client: seconds that one frame takes of each, one after the other
    """

    seconds: np.ndarray
    scheduler: float
    client: float


def simulated(job: Job, workers: int) -> dict:
    """The job with this many workers, event by event. A worker has one frame in hand and takes up one more; the client
    takes frames in their order."""
    n, free, now, begun, taken = len(job.seconds), workers, 0.0, 0, 0
    ready, scheduler_free, client_free, client_busy = set(), 0.0, 0.0, False
    events: list[tuple[float, str, int]] = []
    while True:
        while free and begun < min(n, taken + AHEAD * workers):
            scheduler_free = max(scheduler_free, now) + job.scheduler
            heapq.heappush(events, (scheduler_free + job.seconds[begun], "frame", begun))
            free, begun = free - 1, begun + 1
        if not client_busy and taken in ready:
            client_busy, client_free = True, now + job.client
            heapq.heappush(events, (client_free, "client", taken))
        if not events:
            break
        now, kind, number = heapq.heappop(events)
        if kind == "frame":
            ready.add(number)
            free += 1
        else:
            client_busy, taken = False, taken + 1
    share = job.seconds.sum() / (workers * now)
    return {"workers": workers, "hours": now / 3600, "idle_share": 1 - share,
            "scheduler_busy": n * job.scheduler / now, "client_busy": n * job.client / now}  # fmt: skip


def large_job(costs: list[dict], sizes: dict, name: str, rate: float) -> list[dict]:
    """The simulated job with one scene, for PNG files and for EXR files with all layers; and if the client only took
    PNG's layers from the network. rate: samples per second of a thread"""
    mean = PIXELS * SPP / (rate * THREADS)
    seconds = mean * np.random.default_rng(0).lognormal(-(SPREAD**2) / 2, SPREAD, FRAMES)
    small, large = costs[0], costs[-1]
    per_byte, scheduler_per_byte = (
        max(large[key] - small[key], 0) / (large["bytes"] - small["bytes"])
        for key in ("client_seconds", "scheduler_seconds")
    )
    rows = []
    for suffix, is_written in ((".png", True), (".exr", True), (".png", False)):
        size = sizes[suffix]["layer_bytes"] * PIXELS
        transfer = small["client_seconds"] + size * max(per_byte, 1 / NETWORK)
        client = transfer + is_written * sizes[suffix]["write_seconds"] * PIXELS
        # Results go through the scheduler.
        job = Job(seconds, small["scheduler_seconds"] + size * scheduler_per_byte, client)
        row = {"scene": name, "files": suffix, "written": is_written, "frame_seconds": mean, "frame_bytes": size,
               "transfer_seconds": transfer, "client_seconds": client,
               "scheduler_seconds": job.scheduler, "limit": mean / client,
               "total_bytes": size * FRAMES}  # fmt: skip
        rows.append(row | {"runs": [simulated(job, workers) for workers in WORKERS]})
    return rows


def one_large_picture(costs: list[dict], sizes: dict) -> dict:
    """Limits of one picture in tiles: the numbers of workers that keep scheduler and client busy, each in turn."""
    small = costs[0]
    return {
        "task_seconds": TARGET,
        "scheduler_limit": TARGET / small["scheduler_seconds"],
        "client_limit": TARGET / small["client_seconds"],
        "film_bytes": sizes["film_bytes"] * PIXELS,
    }


def main() -> None:
    arguments = report_parser(__doc__).parse_args()
    rates = {name: samples_per_second(name) for name in SPEEDS}
    costs, scenes, found = overheads(), packages(), sizes()
    report = machine() | {"samples_per_second": rates, "tasks": costs, "packages": scenes, "sizes": found}
    report |= {"picture": one_picture(), "kernel_cache": kernel_cache()}
    report["large_picture"] = one_large_picture(costs, found)
    report["jobs"] = [row for name, rate in rates.items() for row in large_job(costs, found, name, rate)]
    write_report(report, arguments.output)


if __name__ == "__main__":
    main()
