#!/usr/bin/env python3
"""Embree on the rays that `PRPF_RAYS=FOLDER cargo bench --bench rays` wrote: millions a second.

    embree_rays.py FOLDER [PROCESSES]

Each of PROCESSES (1 unless given) traces an equal share of the rays, one ray at a time, in the same tree: `embreex`
holds Python's lock while it traces, so processes that share their memory stand for threads. Best of several runs.
`pip install embreex numpy`; see docs/performance.md.
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
    """Which of the rays hit."""
    origins, directions = rays
    if kind == "shadow":
        return scene.run(origins, directions, dists=np.ones(len(origins), np.float32), query="OCCLUDED") >= 0
    return scene.run(origins, directions, query="INTERSECT") >= 0


def one_process(scene, shares, number, together, results):
    """Traces its shares; for each kind, when each run began and ended, and how many rays hit."""
    spans, hits = {}, {}
    for kind in KINDS:
        rays = shares[kind][number]
        spans[kind] = []
        for _ in range(RUNS):
            together.wait()
            start = time.monotonic()
            hit = trace(scene, rays, kind)
            spans[kind].append((start, time.monotonic()))
        hits[kind] = int(hit.sum())
    results.put((spans, hits))


def main(folder, processes=1):
    folders = sorted(path.parent for path in Path(folder).glob("*/positions"))
    if not folders:
        sys.exit(f"{folder}: no rays in its folders; PRPF_RAYS=FOLDER cargo bench --bench rays writes them")
    fork = multiprocessing.get_context("fork")
    for folder in folders:
        positions = np.fromfile(folder / "positions", np.float32).reshape(-1, 3)
        indices = np.fromfile(folder / "indices", np.uint32).reshape(-1, 3).astype(np.int32)
        scene = rtcore_scene.EmbreeScene()
        mesh = TriangleMesh(scene, positions, indices)
        shares, counts = {}, {}
        for kind in KINDS:
            rays = np.fromfile(folder / kind, np.float32).reshape(-1, 6)
            counts[kind] = len(rays)
            parts = np.array_split(rays, processes)
            shares[kind] = [(part[:, :3].copy(), part[:, 3:].copy()) for part in parts]
        trace(scene, [side[:1] for side in shares["primary"][0]], "primary")  # builds the tree
        together, results = fork.Barrier(processes), fork.SimpleQueue()
        arguments = (together, results)
        workers = [fork.Process(target=one_process, args=(scene, shares, n, *arguments)) for n in range(processes)]
        for worker in workers:
            worker.start()
        done = [results.get() for _ in workers]
        for worker in workers:
            worker.join()
        for kind in KINDS:
            runs = zip(*(spans[kind] for spans, _ in done))
            best = min(max(end for _, end in run) - min(start for start, _ in run) for run in runs)
            # The share of rays that hit: the bench prints the same.
            hit = sum(hits[kind] for _, hits in done) / counts[kind]
            print(f"{folder.name}/{kind}: {counts[kind] / best / 1e6:.2f} M rays/s, {hit:.4f} hit", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], *(int(number) for number in sys.argv[2:3]))
