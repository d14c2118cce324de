#!/usr/bin/env python3
"""Embree on the rays that `PRPF_RAYS=FOLDER cargo bench --bench rays` wrote: millions a second.

One thread, best of several runs. `pip install embreex numpy`; see docs/performance.md.
"""
import sys
import time
from pathlib import Path

import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh

RUNS = 25

folders = sorted(path.parent for path in Path(sys.argv[1]).glob("*/positions"))
if not folders:
    sys.exit(f"{sys.argv[1]}: no rays in its folders; PRPF_RAYS=FOLDER cargo bench --bench rays writes them")
for folder in folders:
    positions = np.fromfile(folder / "positions", np.float32).reshape(-1, 3)
    indices = np.fromfile(folder / "indices", np.uint32).reshape(-1, 3).astype(np.int32)
    scene = rtcore_scene.EmbreeScene()
    mesh = TriangleMesh(scene, positions, indices)
    for name in ["primary", "shadow", "bounce", "incoherent"]:
        rays = np.fromfile(folder / name, np.float32).reshape(-1, 6)
        origins, directions = rays[:, :3].copy(), rays[:, 3:].copy()
        best = float("inf")
        for _ in range(RUNS):
            start = time.perf_counter()
            if name == "shadow":
                hit = scene.run(origins, directions, dists=np.ones(len(rays), np.float32), query="OCCLUDED")
            else:
                hit = scene.run(origins, directions, query="INTERSECT")
            best = min(best, time.perf_counter() - start)
        # The share of rays that hit: the bench prints the same.
        print(f"{folder.name}/{name}: {len(rays) / best / 1e6:.2f} M rays/s, {np.mean(hit >= 0):.4f} hit")
