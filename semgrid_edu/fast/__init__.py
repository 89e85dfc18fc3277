"""The fast twins: the same public names as in the book, for commands, the demo and long runs.

Nothing here is needed to understand a stage. Each twin is held equal to the book's version by a property test, and is
called like it; `build_net` and `load_net` choose the sampler themselves, and filter and CRF hold their numbers in other
arrays inside. Without a twin in the book: `fast_stages`, which is `Stages.fast`, and `with_fast_sampler`. `Cmcdot`
takes `Walls`, but no subclass with rules of its own, which compiled loops can't call. Where a docstring leaves its
parameters to `move`, say, it means the book's `move`. The compiled ones need numba, the extra `fast`:
``pip install semgrid_edu[fast]``.

Examples
--------
>>> from semgrid_edu import fast
>>> tracker = fast.Cmcdot(spec, seed=0)                                                 # doctest: +SKIP
"""

from semgrid_edu.errors import needed

_WHERE: dict[str, str] = {
    # occupancy
    "Cmcdot": "occupancy.cmcdot",
    "DriveTracker": "occupancy.cmcdot",
    "SensorModel": "occupancy.sensor",
    "height_above_ground": "occupancy.ground",
    "look_up": "occupancy.cells",
    "move": "occupancy.steps",
    "predict": "occupancy.steps",
    "resample": "occupancy.steps",
    "scan_evidence": "occupancy.sensor",
    "systematic_resample": "occupancy.steps",
    "track_drive": "occupancy.cmcdot",
    "transition_matrix": "occupancy.steps",
    "update": "occupancy.steps",
    # planes, networks, all stages
    "PlaneSampler": "planes",
    "TrainingSet": "training_set",
    "build_net": "networks",
    "fast_stages": "stages",
    "load_net": "networks",
    "with_fast_sampler": "networks",
    # crf
    "PermutohedralLattice": "crf.lattice",
    "SeparableGaussian": "crf.spatial",
    "bilateral_kernel": "crf.mean_field",
    "mean_field": "crf.mean_field",
}
"""The module that each name comes from: it is loaded when the name is first used."""

__all__ = sorted(_WHERE)


def __getattr__(name: str) -> object:
    """Load a twin when it is first used."""
    if name not in _WHERE:
        raise AttributeError(f"module 'semgrid_edu.fast' has no attribute {name!r}")
    return getattr(needed(f"semgrid_edu.fast.{_WHERE[name]}"), name)


def __dir__() -> list[str]:
    """List the twins, loaded or not."""
    return __all__
