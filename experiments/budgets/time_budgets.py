"""Tests whether renders keep their time budgets.

    python3 experiments/budgets/time_budgets.py PRPF SCENE... [--budgets 5,10,30,60] [--runs N]

Renders each scene with each budget, N times, and compares the wall time of the whole command with the budget. A
render is late if it exceeds the budget by more than the larger of 0.1 s and 1 %. Prints a line of a Markdown table
for each scene and budget. Scenes alternate, so that other load affects all of them alike; still, run nothing else on
the machine. Needs the standard library only.
"""

import argparse
import os
import statistics
import subprocess
import tempfile
import time


def render_seconds(arguments, scene, budget, folder):
    """Wall time of a render."""
    command = [arguments.prpf, "render", scene, "--time", f"{budget}s", "--quiet", "-o", os.path.join(folder, "image.exr")]
    start = time.monotonic()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.monotonic() - start


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("prpf")
    parser.add_argument("scene", nargs="+")
    parser.add_argument("--budgets", default="5,10,30,60")
    parser.add_argument("--runs", type=int, default=10)
    arguments = parser.parse_args()
    print("| budget, s | scene | seconds, median | minimum | maximum | used, median | late |")
    print("| --- | --- | --- | --- | --- | --- | --- |", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for budget in map(float, arguments.budgets.split(",")):
            seconds = {scene: [] for scene in arguments.scene}
            for _ in range(arguments.runs):
                for scene in arguments.scene:
                    seconds[scene].append(render_seconds(arguments, scene, budget, folder))
            for scene, times in seconds.items():
                name = os.path.splitext(os.path.basename(scene))[0]
                late = sum(s > budget + max(0.1, 0.01 * budget) for s in times)
                median = statistics.median(times)
                print(
                    f"| {budget:g} | {name} | {median:.2f} | {min(times):.2f} | {max(times):.2f} "
                    f"| {100 * median / budget:.0f} % | {late} of {len(times)} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
