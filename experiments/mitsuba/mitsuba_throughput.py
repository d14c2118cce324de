#!/usr/bin/env python3
"""Measures the sample throughput of Mitsuba 3 (llvm_ad_rgb) on the scenes of benches/throughput.

Prints millions of samples per second of wall time and of CPU time, best of three runs. Needs `pip install mitsuba`
and a libLLVM of version 16 or later (DRJIT_LIBLLVM_PATH names it).
"""

import os
import sys
import time

import mitsuba as mi

mi.set_variant("llvm_ad_rgb")
import drjit as dr
from mitsuba import ScalarTransform4f as T

SIDE, SPP, RUNS = 512, 64, 3
# Mitsuba's depth counts emission: its 7 is pbrt's 6.
INTEGRATOR = {"type": "path", "max_depth": 7}


def rgb(*values):
    return {"type": "rgb", "value": list(values)}


def diffuse(*values):
    return {"type": "diffuse", "reflectance": rgb(*values)}


def sphere(centre, radius, bsdf):
    return {"type": "sphere", "center": centre, "radius": radius, "bsdf": bsdf}


def view(origin, target, kind="perspective", **lens):
    return {
        "type": kind,
        "fov": 35,
        "to_world": T().look_at(origin=origin, target=target, up=[0, 1, 0]),
        "film": film(),
        "sampler": {"type": "independent"},
        **lens,
    }


def film():
    return {"type": "hdrfilm", "width": SIDE, "height": SIDE, "rfilter": {"type": "box"}, "pixel_format": "rgb"}


def light(*position):
    return {
        "type": "rectangle",
        "to_world": T().translate(position).rotate([1, 0, 0], 90),
        "emitter": {"type": "area", "radiance": rgb(12, 11, 10)},
        "bsdf": diffuse(0, 0, 0),
    }


def plane(bsdf):
    return {"type": "rectangle", "to_world": T().rotate([1, 0, 0], -90).scale(10), "bsdf": bsdf}


def cornell():
    scene = mi.cornell_box()
    scene["integrator"] = INTEGRATOR
    scene["sensor"]["film"] = film()
    scene["sensor"]["sampler"] = {"type": "independent"}
    return scene


def lens():
    checks = {
        "type": "checkerboard",
        "color0": rgb(0.8, 0.8, 0.8),
        "color1": rgb(0.15, 0.15, 0.2),
        "to_uv": T().scale([10, 10, 1]),
    }
    return {
        "type": "scene",
        "integrator": INTEGRATOR,
        "sensor": view([0, 2, 8], [0, 0.8, 0], "thinlens", aperture_radius=0.15, focus_distance=8.0),
        "environment": {"type": "constant", "radiance": rgb(0.4, 0.5, 0.6)},
        "light": light(0, 6, 2),
        "plane": plane({"type": "diffuse", "reflectance": checks}),
        "a": sphere([-2.2, 0.8, 2], 0.8, diffuse(0.7, 0.2, 0.1)),
        "b": sphere([0, 0.8, 0], 0.8, diffuse(0.2, 0.6, 0.2)),
        "c": sphere([2.2, 0.8, -2], 0.8, diffuse(0.2, 0.3, 0.7)),
        "d": sphere([-1, 0.5, -4], 0.5, diffuse(0.7, 0.6, 0.2)),
        "e": sphere([1, 0.4, 3], 0.4, diffuse(0.6, 0.6, 0.6)),
    }


def glossy():
    metal = {
        "type": "roughconductor",
        "distribution": "ggx",
        "alpha": 0.2,
        "eta": rgb(0.2, 0.92, 1.1),
        "k": rgb(3.91, 2.45, 2.14),
    }
    return {
        "type": "scene",
        "integrator": INTEGRATOR,
        "sensor": view([0, 2, 6], [0, 1, 0]),
        "light": light(1, 4, 2),
        "plane": plane(diffuse(0.5, 0.5, 0.5)),
        "ball": sphere([0, 1, 0], 1.0, metal),
    }


def seconds(scene, seed):
    """Returns the wall and CPU seconds of a render."""
    start, used = time.perf_counter(), os.times()
    dr.eval(mi.render(scene, spp=SPP, seed=seed))
    dr.sync_thread()
    end = os.times()
    return time.perf_counter() - start, end.user + end.system - used.user - used.system


def main():
    for name, make in {"cornell": cornell, "lens": lens, "glossy": glossy}.items():
        if sys.argv[1:] and name not in sys.argv[1:]:
            continue
        scene = mi.load_dict(make())
        seconds(scene, 0)  # compiles
        runs = [seconds(scene, seed) for seed in range(1, RUNS + 1)]
        wall, cpu = (SIDE * SIDE * SPP / min(column) / 1e6 for column in zip(*runs))
        print(f"{name}: {wall:.2f} M samples/s, {cpu:.2f} M per CPU second", flush=True)


if __name__ == "__main__":
    main()
