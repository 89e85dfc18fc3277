"""The ways to make ground truth that the policy laboratory compares, and the errors in the data they start from (4)."""

from dataclasses import replace
from typing import NamedTuple

from semgrid_edu.datasets.ground_truth import NO_FLAWS, TruthFlaws, TruthPolicy

REACH = 9
"""Number of scans before, and after, the labelled one: 0.9 s. minikitti has as many before its labelled frames."""
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
    """Return the trials with several scans."""
    around = TruthPolicy(past=REACH, future=REACH)
    return {
        f"{name}, movers {movers}": Trial(replace(policy, movers=movers))
        for name, policy in (
            (f"{REACH} scans before", replace(around, future=0)),
            (f"{REACH} before and after", around),
        )
        for movers in ("smeared", "carved", "carried")
    }


TRIALS = {
    "one scan (the paper)": Trial(),
    "one scan, no clean-up": Trial(TruthPolicy(cleanup=False)),
    "one scan, de-skewed": Trial(TruthPolicy(deskew=True)),
    "one scan, visible to LIDAR": Trial(TruthPolicy(visible_to="lidar")),
    "one scan, visible to camera": Trial(TruthPolicy(visible_to="camera")),
    **_windows(),
    f"{REACH} before and after, movers carved, de-skewed": Trial(TruthPolicy(REACH, REACH, "carved", deskew=True)),
    f"{REACH} before and after, movers carved, visible to camera": Trial(
        TruthPolicy(REACH, REACH, "carved", visible_to="camera")
    ),
    f"{REACH} before and after, movers carved, no clean-up": Trial(TruthPolicy(REACH, REACH, "carved", cleanup=False)),
    "one scan, no errors in the data": Trial(flaws=NO_FLAWS),
    "one scan, error of calibration alone": Trial(
        flaws=replace(NO_FLAWS, rotation=FLAWS.rotation, translation=FLAWS.translation)
    ),
    "one scan, errors of labels alone": Trial(flaws=replace(FLAWS, rotation=0, translation=0, skewed=False)),
    "one scan, skew alone": Trial(flaws=replace(NO_FLAWS, skewed=True)),
}
"""What is compared, by name. The last four show what each kind of error in the data does to the paper's way."""
