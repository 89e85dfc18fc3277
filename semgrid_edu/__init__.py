"""Probabilistic bird's-eye semantic perception, from LIDAR and camera to a semantic grid.

    import semgrid_edu as sg

    drive = sg.sample_drive()
    net = sg.load_net(sg.sample_weights(), drive.camera)
    result = sg.run_frame(drive[0], sg.Stages.of(net))

Start reading at `run_frame` in `pipeline.py`: it calls the five stages by name. What is named here is loaded when it is
first used, so `import semgrid_edu` costs nothing.
"""

from importlib import import_module

__version__ = "0.1.0"

_NAMES = {
    "grid": ("GridSpec",),
    "camera": ("Camera",),
    "frame": ("Frame",),
    "labels": ("KITTI_14", "LABEL_SETS", "LabelSet"),
    "metrics": ("class_accuracy", "confusion_matrix", "frequency_weighted_iou", "pixel_accuracy"),
    "errors": ("ArgumentError", "DataError"),
    "pipeline": ("FrameResult", "Stages", "run_frame", "run_pipeline"),
    "occupancy": (
        *("Belief", "Bof", "BofParams", "Cmcdot", "CmcdotParams", "DriveTracker", "Evidence", "LogOddsGrid"),
        *("PlanarMotion", "SensorModel", "State", "Walls", "move", "predict", "resample", "track_drive", "update"),
    ),
    "planes": ("PlaneSampler", "plane_heights", "plane_pixels", "sample_planes_naive"),
    "networks": ("Architecture", "SemanticGridNet", "build_net", "build_segmenter", "load_net", "save_net"),
    "crf": (
        *("CrfParams", "energy", "exact_marginals", "free_energy", "mean_field", "mean_field_naive"),
        "most_likely",
    ),
    "memory": ("ClassMemory", "MemoryParams", "remember_drive"),
    "graphical": (
        *("Factor", "GraphicalModel", "d_separated", "draw", "eliminate", "enumerate_marginals", "max_product"),
        *("sum_product", "why_dependent"),
    ),
    "training": ("TrainingParams", "train"),
    "datasets": ("KittiRawDrive", "PandasetScene", "SemanticKittiSequence"),
    "datasets.ground_truth": ("lidar_truth",),
    "datasets.samples": ("real_drive", "real_weights", "sample_drive", "sample_weights"),
}
"""The public names, by the module that they come from."""

_WHERE = {name: module for module, names in _NAMES.items() for name in names}

__all__ = sorted([*_WHERE, "fast"])


def __getattr__(name: str) -> object:
    """Load a public name when it is first used (PEP 562)."""
    if name == "fast":
        return import_module("semgrid_edu.fast")
    if name not in _WHERE:
        raise AttributeError(f"module 'semgrid_edu' has no attribute {name!r}")
    return getattr(import_module(f"semgrid_edu.{_WHERE[name]}"), name)


def __dir__() -> list[str]:
    """List the public names, loaded or not."""
    return __all__
