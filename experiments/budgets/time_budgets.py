"""Do budgets of time hold?

    python3 experiments/budgets/time_budgets.py PRPF SCENE... [--budgets 5,10,30,60] [--runs N]

Renders each scene with each budget, N times, and holds the wall time of the whole command, from its start to
its end, against the budget. Late is what takes longer than the budget by more than the larger of 0.1 s and 1 %.
One line of Markdown table for each scene and budget, as soon as it is known; scenes alternate, so that no one
has the machine's worst minute to itself. The machine has to be quiet. Standard library only.
"""

import argparse
import os
import statistics
import subprocess
import tempfile
import time


def taken(arguments, scene, budget, folder):
    command = [arguments.prpf, "render", scene, "--time", f"{budget}s", "--quiet", "-o", os.path.join(folder, "image.exr")]
    began = time.monotonic()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.monotonic() - began


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("prpf")
    parser.add_argument("scene", nargs="+")
    parser.add_argument("--budgets", default="5,10,30,60")
    parser.add_argument("--runs", type=int, default=10)
    arguments = parser.parse_args()
    print("| budget, s | scene | taken, median | fewest | most | used, median | late |")
    print("| --- | --- | --- | --- | --- | --- | --- |", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for budget in map(float, arguments.budgets.split(",")):
            seconds = {scene: [] for scene in arguments.scene}
            for _ in range(arguments.runs):
                for scene in arguments.scene:
                    seconds[scene].append(taken(arguments, scene, budget, folder))
            for scene, all_taken in seconds.items():
                name = os.path.splitext(os.path.basename(scene))[0]
                late = sum(s > budget + max(0.1, 0.01 * budget) for s in all_taken)
                median = statistics.median(all_taken)
                print(
                    f"| {budget:g} | {name} | {median:.2f} | {min(all_taken):.2f} | {max(all_taken):.2f} "
                    f"| {100 * median / budget:.0f} % | {late} of {len(all_taken)} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
