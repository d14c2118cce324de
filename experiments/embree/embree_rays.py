#!/usr/bin/env python3
"""Measures Embree's ray throughput on the rays that `PRPF_RAYS=FOLDER cargo bench --bench rays` wrote.

    embree_rays.py FOLDER [PROCESSES]

Each of PROCESSES (default 1) traces an equal part of the rays, one ray at a time, in the same BVH. `embreex` holds
Python's lock while it traces, so processes with shared memory take the place of threads. Prints millions of rays per
second, the best of several runs. Needs `pip install embreex numpy`; see docs/performance.md.
"""
import multiprocessing
import sys
import time
from pathlib import Path

import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh

RUNS = 25
KINDS = ["primary", "shadow", "bounce", "incoherent"]


def trace(scene, rays, kind):
    """Returns which of the rays hit."""
    origins, directions = rays
    if kind == "shadow":
        return scene.run(origins, directions, dists=np.ones(len(origins), np.float32), query="OCCLUDED") >= 0
    return scene.run(origins, directions, query="INTERSECT") >= 0


def run_process(scene, parts, number, barrier, results):
    """Traces the process's parts; puts the start and end of each run and the number of hits, by kind."""
    spans, hits = {}, {}
    for kind in KINDS:
        rays = parts[kind][number]
        spans[kind] = []
        for _ in range(RUNS):
            barrier.wait()
            start = time.monotonic()
            hit = trace(scene, rays, kind)
            spans[kind].append((start, time.monotonic()))
        hits[kind] = int(hit.sum())
    results.put((spans, hits))


def main(folder, processes=1):
    folders = sorted(path.parent for path in Path(folder).glob("*/positions"))
    if not folders:
        sys.exit(f"{folder}: its folders hold no rays; `PRPF_RAYS=FOLDER cargo bench --bench rays` writes them")
    fork = multiprocessing.get_context("fork")
    for folder in folders:
        positions = np.fromfile(folder / "positions", np.float32).reshape(-1, 3)
        indices = np.fromfile(folder / "indices", np.uint32).reshape(-1, 3).astype(np.int32)
        scene = rtcore_scene.EmbreeScene()
        mesh = TriangleMesh(scene, positions, indices)
        parts, counts = {}, {}
        for kind in KINDS:
            rays = np.fromfile(folder / kind, np.float32).reshape(-1, 6)
            counts[kind] = len(rays)
            split = np.array_split(rays, processes)
            parts[kind] = [(part[:, :3].copy(), part[:, 3:].copy()) for part in split]
        trace(scene, [side[:1] for side in parts["primary"][0]], "primary")  # builds the BVH
        barrier, results = fork.Barrier(processes), fork.SimpleQueue()
        arguments = (barrier, results)
        workers = [fork.Process(target=run_process, args=(scene, parts, n, *arguments)) for n in range(processes)]
        for worker in workers:
            worker.start()
        done = [results.get() for _ in workers]
        for worker in workers:
            worker.join()
        for kind in KINDS:
            runs = zip(*(spans[kind] for spans, _ in done))
            best = min(max(end for _, end in run) - min(start for start, _ in run) for run in runs)
            # The fraction of rays that hit, which the bench prints as well.
            hit = sum(hits[kind] for _, hits in done) / counts[kind]
            print(f"{folder.name}/{kind}: {counts[kind] / best / 1e6:.2f} M rays/s, {hit:.4f} hit", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], *(int(number) for number in sys.argv[2:3]))
