"""From LIDAR scans to a grid of free, static, dynamic and unknown cells: l -> o (paper, section 3.2).

`evidence` says what one scan tells; `steps` holds the four steps of the filter, each a pure function on a
`FilterState`; `Cmcdot` runs them, and `track_drive` runs it over a drive.
"""

from semgrid_edu.occupancy.cmcdot import Cmcdot
from semgrid_edu.occupancy.evidence import Evidence, scan_evidence, scan_evidence_literal
from semgrid_edu.occupancy.motion import PlanarMotion
from semgrid_edu.occupancy.params import CmcdotParams, transition_matrix
from semgrid_edu.occupancy.sensor import SensorModel
from semgrid_edu.occupancy.state import N_STATES, Belief, FilterState, Particles, State
from semgrid_edu.occupancy.steps import move, predict, resample, update
from semgrid_edu.occupancy.tracking import track_drive

__all__ = [
    "N_STATES",
    "Belief",
    "Cmcdot",
    "CmcdotParams",
    "Evidence",
    "FilterState",
    "Particles",
    "PlanarMotion",
    "SensorModel",
    "State",
    "move",
    "predict",
    "resample",
    "scan_evidence",
    "scan_evidence_literal",
    "track_drive",
    "transition_matrix",
    "update",
]
