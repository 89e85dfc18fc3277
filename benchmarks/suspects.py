"""Measure what makes the filter call standing things DYNAMIC, one suspect after the other (companion of lecture 04).

    python benchmarks/suspects.py --out docs/results/suspects.json

writes the counts that the companion reads: on two streets for each suspect, on the others for the filter as it was, for
the simplest cure and for the one that was chosen.
"""

import argparse
import sys
from datetime import UTC, datetime
from pathlib import Path

from semgrid_edu.grid import GridSpec
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import versions
from semgrid_edu.workshop.simulation.street.plan import TEST_STREETS

sys.path.append(str(Path(__file__).resolve().parents[1] / "notebooks"))

from worlds.lecture_04_suspects import BARRED, MENDED, SUSPECTS, measure_suspects

CLOSELY = ("walls", "mesh and hedge")
CURES = (next(iter(SUSPECTS)), BARRED, MENDED)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=4)
    parser.add_argument("--out", required=True, help="a JSON file for the counts")
    arguments = parser.parse_args()
    began = datetime.now(UTC)
    drives = range(arguments.drives)
    spec = GridSpec.compact()
    others = [street for street in TEST_STREETS if street not in CLOSELY]
    found = measure_suspects(spec, CLOSELY, drives) | measure_suspects(spec, others, drives, CURES)
    result = {
        "counts": found,
        "grid": "compact",
        "drives": arguments.drives,
        "command": f"python benchmarks/suspects.py --drives {arguments.drives}",
        "seed": 0,
        "date": f"{began:%Y-%m-%d}",
        "minutes": round((datetime.now(UTC) - began).total_seconds() / 60, 1),
        "versions": versions("numpy", "numba", "embreex"),
    }
    write_json(arguments.out, result)


if __name__ == "__main__":
    main()
