"""The ways to make ground truth that the policy laboratory compares, and the errors in the data they start from (4)."""

from dataclasses import replace
from typing import NamedTuple

from semgrid_edu.datasets.ground_truth import NO_FLAWS, TruthFlaws, TruthPolicy
from semgrid_edu.datasets.ground_truth.policy import MOVERS

REACH = 9
"""Number of scans before, and after, the labelled one: 0.9 s. minikitti has as many before its labelled frames."""
BEFORE, AROUND = f"{REACH} scans before", f"{REACH} before and after"
OWN = TruthPolicy(REACH, REACH, "own", "carved", vote="majority")
FLAWS = TruthFlaws()


class Trial(NamedTuple):
    """One way to make ground truth, and from what.

    Parameters
    ----------
    policy : TruthPolicy
        The way.
    flaws : TruthFlaws
        The errors of calibration, labels and scans.
    """

    policy: TruthPolicy = TruthPolicy()
    flaws: TruthFlaws = FLAWS


def _windows() -> dict[str, Trial]:
    """Return the trials with several scans, so that most cells have many returns: their majority decides."""
    before = TruthPolicy(past=REACH, vote="majority")
    around = replace(before, future=REACH)
    windows = {
        BEFORE: before,
        AROUND: around,
        f"{AROUND}, own labels": replace(around, labels="own"),
    }
    return {
        f"{name}, movers {movers}": Trial(replace(policy, movers=movers))
        for name, policy in windows.items()
        for movers in MOVERS
    }


TRIALS = {
    "one scan (the paper)": Trial(),
    "one scan, no clean-up": Trial(TruthPolicy(cleanup="none")),
    "one scan, all classes spread alike": Trial(TruthPolicy(cleanup="spread")),
    "one scan, de-skewed": Trial(TruthPolicy(deskew=True)),
    "one scan, visible to LIDAR": Trial(TruthPolicy(visible_to="lidar")),
    "one scan, visible to camera": Trial(TruthPolicy(visible_to="camera")),
    "one scan, majority of returns": Trial(TruthPolicy(vote="majority")),
    **_windows(),
    f"{AROUND}, own labels, movers carved, no clean-up": Trial(replace(OWN, cleanup="none")),
    f"{AROUND}, own labels, movers carved, what stands wins": Trial(replace(OWN, vote="standing")),
    f"{AROUND}, own labels, movers carved, de-skewed": Trial(replace(OWN, deskew=True)),
    f"{AROUND}, own labels, movers carved, visible to LIDAR": Trial(replace(OWN, visible_to="lidar")),
    f"{AROUND}, own labels, movers carved, visible to camera": Trial(replace(OWN, visible_to="camera")),
    "one scan, no errors in the data": Trial(flaws=NO_FLAWS),
    "one scan, error of calibration alone": Trial(
        flaws=replace(NO_FLAWS, rotation=FLAWS.rotation, translation=FLAWS.translation)
    ),
    "one scan, errors of labels alone": Trial(flaws=replace(FLAWS, rotation=0, translation=0, skewed=False)),
    "one scan, skew alone": Trial(flaws=replace(NO_FLAWS, skewed=True)),
}
"""What is compared, by name. The last four show what each kind of error in the data does to the paper's way."""
