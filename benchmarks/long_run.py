"""Run the filter for hours of a made-up drive, twice: `python benchmarks/long_run.py [--steps 10000] [--out FILE]`.

Prints what each stretch found: cells that don't sum to 1, memory, and whether the second run gave the same bits.
"""

import argparse
import time
from dataclasses import asdict
from datetime import UTC, datetime

from semgrid_edu.experiments.long_run import Checkpoint, long_run
from semgrid_edu.files import write_json
from semgrid_edu.grid import GridSpec
from semgrid_edu.provenance import versions


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--grid", choices=("compact", "paper"), default="compact")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", help="a JSON file for the figures")
    arguments = parser.parse_args()
    began = datetime.now(UTC)
    first, second = (run(arguments.steps, arguments.grid, arguments.seed) for _ in range(2))
    same = [a.digest == b.digest for a, b in zip(first, second, strict=True)]
    print("bit-identical in both runs" if all(same) else f"the runs differ from checkpoint {same.index(False)} on")
    if arguments.out:
        result = {
            "checkpoints": [asdict(checkpoint) for checkpoint in first],
            "memory of second run": [round(checkpoint.memory, 1) for checkpoint in second],
            "bit-identical": all(same),
            "command": f"python benchmarks/long_run.py --steps {arguments.steps} --grid {arguments.grid}",
            "seed": arguments.seed,
            "date": f"{began:%Y-%m-%d}",
            "minutes": round((datetime.now(UTC) - began).total_seconds() / 60, 1),
            "versions": versions("numpy", "numba"),
        }
        write_json(arguments.out, result)


def run(steps: int, grid: str, seed: int) -> list[Checkpoint]:
    """Run once and print a row for each tenth."""
    print("   steps  worst |sum - 1|  lowest P  cells with velocity  memory (MB)  s    digest")
    began, checkpoints = time.perf_counter(), []
    for found in long_run(steps, max(1, steps // 10), getattr(GridSpec, grid)(), seed=seed):
        checkpoints.append(found)
        print(
            f"{found.step:8,}  {found.worst_sum:15.1e}  {found.lowest:8.0e}  {found.velocities:19,}"
            f"  {found.memory:11.1f}  {time.perf_counter() - began:4.0f}  {found.digest[:12]}"
        )
    return checkpoints


if __name__ == "__main__":
    main()
