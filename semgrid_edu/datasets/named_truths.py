"""Ways to make ground truth that have names, so that a command or the folder of a run can ask for one (section 4)."""

from dataclasses import replace

from semgrid_edu.datasets.ground_truth import TruthPolicy

ACCUMULATED = TruthPolicy(past=9, vote="majority")
"""The labelled scan and the nine before it, all labelled by the one labelled image, as in KITTI: the scan is the last
of 0.9 s, and most cells have many returns, whose majority decides."""

POLICIES = {
    "lidar": TruthPolicy(),
    "no-cleanup": TruthPolicy(cleanup="none"),
    "accumulated-carved": replace(ACCUMULATED, movers="carved"),
    "accumulated-smeared": ACCUMULATED,
    "accumulated-carried": replace(ACCUMULATED, movers="carried"),
    "camera-mask": TruthPolicy(visible_to="camera"),
    "de-skewed": TruthPolicy(deskew=True),
}
"""The policies that networks learn from, by name; "lidar" is the paper's, as far as it says. The others change one
thing each, but for the accumulated ones, which also take the majority's class."""
