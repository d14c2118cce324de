#!/usr/bin/env python3
"""Models how one render by several processes scales, from constants that it measures.

    scaling_model.py measure PRPF [--runs 3]    # writes measured.json
    scaling_model.py model                      # prints the table, and writes scaling.svg

`measure` renders courtyard (640x360, 64 samples per pixel, nlm) by two processes of one thread. From the reports come the
samples per second of a thread, the seconds of a filter pass per pixel, margins included, the seconds that the first process
takes alone per pixel, the imbalance, and the bytes that a process sends, beside those that the model has. Where adaptive samples are
comes from a state of figure.

`model` divides an image among the processes as the program does (recursive bisection of tiles of 16x16 by cost) and adds up,
for each batch of samples, in seconds:

    samples        of the process with the most of them, times the measured imbalance
    filter         of the process with the largest rectangle with its margin
    first process  planning a batch, and what a pass takes beside the filter
    communication  through the connection of the first process, full duplex: counts to the others; statistics and results from
                   them; margins, in parallel; LATENCY for each message of the first process

It does not model the start, reading the scene, writing files, and a network that many processes of a node share.
"""

import argparse
import json
import math
import os
import statistics
import subprocess
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
SCENES = HERE.parents[1] / "scenes"
TIMED, UNEVEN = "courtyard/courtyard.pbrt", "figure/figure.pbrt"
WIDTH, HEIGHT, SPP = 640, 360, 64
TILE = 16
# Reach of nlm in pixels (src/filter/nlm)
MARGIN = 68
# Bytes of a pixel: its counts and the moments of its radiance, by which samples are placed; its filter result (17
# planes); its samples in a step
PLACING, RESULT, STEP_COUNT = 4 * 4 + 3 * 3 * 8, 17 * 4, 1
# Samples per pixel of the first, the largest batch, and a step (src/progressive/schedule.rs)
PILOT, LARGEST, STEP = 8, 64, 4
# Assumed, not measured
THREADS = 16
LATENCY = 10e-6

RESOLUTIONS = {"1920x1080": (1920, 1080), "3840x2160": (3840, 2160), "7680x4320": (7680, 4320)}
BANDWIDTHS = {"10 Gb/s": 10e9 / 8, "100 Gb/s": 100e9 / 8}
PROCESSES = [2**k for k in range(11)]


def bisect(sums, tiles, parts):
    """Divides a rectangle of tiles (x0, x1, y0, y1) into rectangles of about equal cost, as src/distributed/partition.rs."""
    if parts == 1:
        return [tiles]
    x0, x1, y0, y1 = tiles
    is_wide = x1 - x0 >= y1 - y0
    side, across = (x1 - x0, y1 - y0) if is_wide else (y1 - y0, x1 - x0)
    first = parts // 2
    least, most = -(-first // across), side - -(-(parts - first) // across)
    if least > most:
        least = most = side // 2
        first = least * across

    def split(at):
        if is_wide:
            return (x0, x0 + at, y0, y1), (x0 + at, x1, y0, y1)
        return (x0, x1, y0, y0 + at), (x0, x1, y0 + at, y1)

    wanted = cost(sums, tiles) * first / parts
    at = min(range(least, most + 1), key=lambda at: abs(cost(sums, split(at)[0]) - wanted))
    before, after = split(at)
    return bisect(sums, before, first) + bisect(sums, after, parts - first)


def cost(sums, tiles):
    x0, x1, y0, y1 = tiles
    return sums[y1, x1] - sums[y0, x1] - sums[y1, x0] + sums[y0, x0]


def with_margin(rectangle, width, height):
    """Returns the pixels of a rectangle (x0, x1, y0, y1) and its margin."""
    x0, x1, y0, y1 = rectangle
    return (min(x1 + MARGIN, width) - max(x0 - MARGIN, 0)) * (min(y1 + MARGIN, height) - max(y0 - MARGIN, 0))


class Division:
    """How an image is divided: the largest fraction of the samples, and pixels with and without the margin, of a process."""

    def __init__(self, measured, width, height, processes):
        columns, rows = -(-width // TILE), -(-height // TILE)
        # The measured samples of each tile, as if this image showed the same
        tiles = np.array(measured["samples_of_tiles"], dtype=float)
        y = np.arange(rows) * tiles.shape[0] // rows
        x = np.arange(columns) * tiles.shape[1] // columns
        sums = np.zeros((rows + 1, columns + 1))
        sums[1:, 1:] = tiles[np.ix_(y, x)].cumsum(axis=0).cumsum(axis=1)
        parts = bisect(sums, (0, columns, 0, rows), processes)
        self.fraction = max(cost(sums, part) for part in parts) / sums[-1, -1]
        pixels = [[min(edge * TILE, size) for edge, size in zip(part, (width, width, height, height))] for part in parts]
        own = [(x1 - x0) * (y1 - y0) for x0, x1, y0, y1 in pixels]
        grown = [with_margin(rectangle, width, height) for rectangle in pixels]
        self.filtered = max(grown)
        self.margin = max(g - o for g, o in zip(grown, own))
        # Pixels of the processes other than the first
        self.others = width * height - own[0]


def batches(spp, largest):
    """Returns the samples per pixel of each batch of a render (src/progressive/schedule.rs)."""
    found, total = [], 0
    last = min(spp // 4, largest)
    while total < spp:
        batch = min(total or PILOT, largest, spp - total)
        to_last = spp - last - total
        batch = spp - total if to_last < last // 4 else min(batch, to_last)
        found.append(batch)
        total += batch
    return found


def communication(measured, division, processes, spp, bandwidth):
    """Returns the seconds in which a batch of SPP samples per pixel and its pass send, and receive."""
    steps = math.ceil(spp / STEP)
    moved = division.others * (steps * STEP_COUNT + PLACING + RESULT) + division.margin * measured["bytes_per_pixel"]
    # Counts and an answer in each step; statistics and results; margins of about eight neighbours
    messages = (processes - 1) * (2 * steps + 2) + 8
    return moved / bandwidth + messages * LATENCY if processes > 1 else 0.0


def seconds(measured, division, pixels, processes, spp, bandwidth):
    """Returns the seconds of a batch of SPP samples per pixel with its pass."""
    samples = spp * pixels * division.fraction / (measured["samples_per_second"] * THREADS)
    excess = 1.0 + measured["imbalance"] if processes > 1 else 1.0
    first = pixels * (measured["planning_seconds"] + measured["pass_seconds"])
    filtering = division.filtered * measured["filter_seconds"] / THREADS
    return samples * excess + filtering + first + communication(measured, division, processes, spp, bandwidth)


def constants(report):
    """Returns the constants of one run by two processes of one thread."""
    pixels, processes = WIDTH * HEIGHT, report["processes"]
    passes, sample_batches = len(report["batches"]), len(batches(SPP, LARGEST))
    render = [process["render"] for process in processes]
    # Two rectangles beside each other
    filtered = 2 * (WIDTH // 2 + MARGIN) * HEIGHT
    alone = sum(entry["filter_seconds"] for entry in report["batches"]) - processes[0]["filter"]
    bytes_per_pixel = 4 * 4 + 3 * 8 * len(report["statistics"])
    # What the other process should have sent, as the model has it: one exchange of everything, at the end
    others = processes[1]["pixels"]
    predicted = others * (bytes_per_pixel + (passes - 1) * PLACING + (sample_batches - passes) * PLACING + passes * RESULT)
    predicted += passes * MARGIN * HEIGHT * bytes_per_pixel
    return {
        "samples_per_second": report["samples_total"] / sum(render),
        "imbalance": report["seconds"]["render"] / statistics.mean(render) - 1,
        "filter_seconds": sum(process["filter"] for process in processes) / passes / filtered,
        "pass_seconds": alone / passes / pixels,
        "planning_seconds": report["seconds"]["allocate"] / sample_batches / pixels,
        "bytes_per_pixel": bytes_per_pixel,
        "bytes_sent": processes[1]["bytes_sent"],
        "bytes_predicted": predicted,
    }


def measure(program, runs):
    """Renders, and writes the constants."""
    environment = {**os.environ, "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1"}
    environment["OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"] = "1"
    with tempfile.TemporaryDirectory() as name:
        image, report, state, arrays = (str(Path(name) / file) for file in ("i.exr", "r.json", "s.state", "a.npz"))
        render = [program, "render", "--quiet", "--denoiser", "nlm", "-o", image]
        found = []
        for _ in range(runs):
            command = ["mpirun", "-q", "-n", "2", *render, str(SCENES / TIMED), "--resolution", f"{WIDTH}x{HEIGHT}"]
            command += ["--spp", str(SPP), "--threads", "1", "--report", report]
            subprocess.run(command, check=True, env=environment)
            found.append(constants(json.loads(Path(report).read_text())))
            print(json.dumps(found[-1]), flush=True)
        # Where adaptive samples are
        subprocess.run([*render, str(SCENES / UNEVEN), "--spp", "32", "--state", state], check=True)
        subprocess.run([program, "export", state, "-o", arrays], check=True)
        with np.load(arrays) as loaded:
            counts = loaded["count"]
    medians = {key: statistics.median(run[key] for run in found) for key in found[0]}
    starts = [np.arange(0, size, TILE) for size in counts.shape]
    tiles = np.add.reduceat(np.add.reduceat(counts, starts[0], axis=0), starts[1], axis=1)
    medians["samples_of_tiles"] = tiles.astype(int).tolist()
    (HERE / "measured.json").write_text(json.dumps(medians) + "\n")


def efficiency(measured, divisions, pixels, spp, largest, bandwidth):
    """Returns, for each number of processes, the time of one process over N times that of N; `spp` is a function of N."""
    def total(processes, samples):
        division = divisions[processes]
        return sum(seconds(measured, division, pixels, processes, batch, bandwidth) for batch in batches(samples, largest))

    return [total(1, spp(n)) / (n * total(n, spp(n))) for n in PROCESSES]


def model():
    """Prints the table, and draws the efficiencies."""
    import matplotlib.pyplot as plt

    measured = json.loads((HERE / "measured.json").read_text())
    kinds = {
        "strong: 1024 samples per pixel": (lambda n: 1024, LARGEST),
        "weak: 16 N samples per pixel": (lambda n: 16 * n, LARGEST),
        "weak, batches without a largest size": (lambda n: 16 * n, 10**9),
    }
    plt.rcParams["svg.fonttype"] = "none"
    plt.rcParams["svg.hashsalt"] = "scaling"
    figure, panels = plt.subplots(1, len(kinds), figsize=(12, 3.8), sharey=True, layout="constrained")
    print("| image | network | received per batch, GB | s | shortest batch with 5 %, s | "
          + " | ".join(f"{name}, N = 64 / 1024" for name in kinds) + " |")
    print("| --- " * (5 + len(kinds)) + "|")
    for colour, (name, (width, height)) in enumerate(RESOLUTIONS.items()):
        divisions = {n: Division(measured, width, height, n) for n in PROCESSES}
        for style, (network, bandwidth) in zip(("--", "-"), BANDWIDTHS.items()):
            # The largest batch among many processes
            most = PROCESSES[-1]
            spent = communication(measured, divisions[most], most, LARGEST, bandwidth)
            received = divisions[most].others * (PLACING + RESULT) / 1e9
            cells = [name, network, f"{received:.2f}", f"{spent:.2g}", f"{spent / 0.05:.2g}"]
            for panel, (spp, largest) in zip(panels, kinds.values()):
                found = efficiency(measured, divisions, width * height, spp, largest, bandwidth)
                panel.plot(PROCESSES, found, style, color=f"C{colour}", label=f"{name}, {network}")
                cells.append(f"{found[PROCESSES.index(64)]:.2f} / {found[-1]:.2f}")
            print("| " + " | ".join(cells) + " |")
    for panel, name in zip(panels, kinds):
        panel.set(title=name, xscale="log", xlabel=f"processes of {THREADS} threads", ylim=(0, 1.05))
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("efficiency (modelled)")
    panels[0].legend(fontsize="small")
    figure.savefig(HERE / "scaling.svg", metadata={"Date": None})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    measuring = commands.add_parser("measure")
    measuring.add_argument("program")
    measuring.add_argument("--runs", type=int, default=3)
    commands.add_parser("model")
    options = parser.parse_args()
    if options.command == "measure":
        measure(options.program, options.runs)
    else:
        model()


if __name__ == "__main__":
    main()
