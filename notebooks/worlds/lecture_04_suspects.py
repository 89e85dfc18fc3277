"""Suspected causes of static things called DYNAMIC, which `04_real_streets` and `benchmarks/suspects.py` switch off."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from unittest.mock import patch

import numpy as np

from semgrid_edu.fast import Cmcdot
from semgrid_edu.fast.occupancy import cellwise
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import CmcdotParams
from semgrid_edu.workshop.simulation import simulate
from semgrid_edu.workshop.simulation.drive import PERIOD, SimulatedDrive
from semgrid_edu.workshop.simulation.sensors.raycast import RayMesh
from semgrid_edu.workshop.simulation.sensors.rig import KITTI_RIG, Rig
from semgrid_edu.workshop.simulation.things.materials import Kind
from worlds.lecture_04_scenes import KnownScene, SceneHistory, true_cells
from worlds.lecture_04_street_scores import StreetScores

BEFORE = CmcdotParams(walls=None, first_sight=(0.93, 0.067, 0.003))
"""The filter before the two rules against phantoms, with its `first_sight` of that time."""
FRAMES = 36
"""Frames of a drive, 3.5 s."""
BARRED = "no arrivals in UNKNOWN cells"
MENDED = "the two rules"
GROUPS = {"border": ("fences", "walls")} | {
    name: (name,) for name in ("scenery", "moving cars", "walkers, near", "walkers, far", "left")
}
"""The groups of cells counted here, each with the groups of `StreetScores` that it combines."""
_OPAQUE = 1e6


def opaque(drive: SimulatedDrive) -> None:
    """Make porous things opaque: each wire mesh, hedge or pane stops every ray that hits it."""
    if drive.porous:
        drive.porous = replace(drive.porous, opacity=np.full_like(drive.porous.opacity, _OPAQUE))


def without_pillars(drive: SimulatedDrive) -> None:
    """Remove the pillars in front of a border, and with them all other poles of the street.

    The truth of the drive keeps the pillars' cells, but no ray meets them.
    """
    shape, keep = drive.static.shape, drive.static.shape.kind != Kind.POLE
    of_triangles = ("faces", "normals", "colour", "material", "kind")
    left = replace(shape, **{name: getattr(shape, name)[keep] for name in of_triangles})
    drive.static = replace(RayMesh.of([left], [0]), instance=drive.static.instance[keep])


def arrivals_barred() -> AbstractContextManager:
    """Return a context in which the filter treats each arrival as coming out of a static thing.

    So nothing may arrive in a cell that hasn't been seen to be free. This replaces the compiled rule of
    `cellwise.collide`, because no parameter of the filter goes so far.

    Returns
    -------
    context manager
    """

    def collide(mixed, newborn, going, stays, arrives, doubtful):
        everything = np.minimum(arrives, np.float32(cellwise.MAX_MOVE_PROBABILITY))
        return cellwise.collide(mixed, newborn, going, stays, arrives, everything)

    return patch("semgrid_edu.fast.occupancy.steps.collide", collide)


@dataclass(frozen=True)
class Suspect:
    """How to switch off a suspect: in the street, the sensors, the filter's parameters, or its code."""

    change: Callable[[SimulatedDrive], None] | None = None
    rig: Rig = KITTI_RIG
    params: CmcdotParams = BEFORE
    context: Callable[[], AbstractContextManager] = nullcontext

    @property
    def in_the_filter(self) -> bool:
        """Whether only the filter changes, and not the drive."""
        return self.change is None and self.rig == KITTI_RIG


SUSPECTS = {
    "as it was": Suspect(),
    "nothing transparent": Suspect(change=opaque),
    "no pillars": Suspect(change=without_pillars),
    "exact poses": Suspect(rig=replace(KITTI_RIG, packet_interval=0.0)),
    "no births at first sight": Suspect(params=replace(BEFORE, first_sight=(0.933, 0.067, 0.0))),
    BARRED: Suspect(context=arrivals_barred),
    MENDED: Suspect(params=CmcdotParams()),
}
"""The suspects in turn; the first switches nothing off, and the last is the present filter."""


def scenes_of(street: str, number: int, spec: GridSpec, suspect: Suspect) -> tuple[SimulatedDrive, list[KnownScene]]:
    """Return a drive through a street of `TEST_STREETS`, `number` being its seed, and its scenes on the grid."""
    drive = simulate(number, FRAMES, street, suspect.rig)
    if suspect.change:
        suspect.change(drive)
    past = SceneHistory(spec)
    return drive, [past.add(drive.scan(k), true_cells(drive, k * PERIOD, spec)) for k in range(drive.n_frames)]


def run_filter(
    drive: SimulatedDrive, scenes: Sequence[KnownScene], suspect: Suspect, scores: StreetScores, seed: int = 0
) -> None:
    """Run CMCDOT over the scenes of a drive; `scores` takes the counts, and `seed` is that of the particles."""
    tracker = Cmcdot(scores.spec, suspect.params, seed=seed)
    scores.begin_drive()
    with suspect.context():
        for scene in scenes:
            scores.add(scene, tracker.step(scene.frame.points_grid, scene.motion, PERIOD))


def measure_suspects(
    spec: GridSpec, streets: Sequence[str], drives: Sequence[int], suspects: Sequence[str] = tuple(SUSPECTS)
) -> dict[str, dict[str, dict]]:
    """Return the `counts` of drives (seeds) through each street, with each suspect switched off: [street][suspect]."""
    result = {}
    for street in streets:
        scores = {name: StreetScores(spec) for name in suspects}
        for number in drives:
            as_it_is = scenes_of(street, number, spec, Suspect())
            for name in suspects:
                suspect = SUSPECTS[name]
                drive, scenes = as_it_is if suspect.in_the_filter else scenes_of(street, number, spec, suspect)
                run_filter(drive, scenes, suspect, scores[name])
        result[street] = {name: counts(one) for name, one in scores.items()}
    return result


def counts(scores: StreetScores) -> dict[str, list[int]]:
    """Return for each of `GROUPS` how many cells were hit, and how many of them were called DYNAMIC.

    In "left": how many cells something moving has left, and how many of them were still called occupied.
    """
    of = {name: [scores.cells.get(one, (0, 0)) for one in group] for name, group in GROUPS.items()}
    return {name: [sum(n for n, _ in pairs), sum(part for _, part in pairs)] for name, pairs in of.items()}
