"""From LIDAR scans to a grid of free, static, dynamic and unknown cells: l -> o (paper, section 3.2).

A `Sensor` turns each scan into `Evidence`; the package's default is `SensorModel`. `steps` holds the four steps of the
filter, each from one `FilterState` to the next. `Cmcdot` runs the steps, and `track_drive` runs it over a drive.
`LogOddsGrid` and `Bof` are the filters that came before it: the binary grid, and the exact filter on a lattice of
velocities. `semgrid_edu.fast` has compiled twins of what takes long.

In reading order: `planar_motion`, `state`; `polar`, `sensor`; `log_odds`; `walls`, `world`, `steps`, `cmcdot`;
`bof_state`, `bof`.
"""

from semgrid_edu.occupancy.bof import Bof, bof_move, bof_predict, bof_update, bof_velocity
from semgrid_edu.occupancy.bof_state import BofParams, BofState, VelocityLattice
from semgrid_edu.occupancy.cmcdot import Cmcdot, DriveTracker, track_drive
from semgrid_edu.occupancy.log_odds import (
    LogOddsGrid,
    LogOddsParams,
    log_odds,
    probability,
    smear_area,
    update_log_odds,
)
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.sensor import Evidence, Measurement, Scan, Sensor, SensorModel, scan_evidence
from semgrid_edu.occupancy.state import (
    N_STATES,
    Belief,
    FilterState,
    Particles,
    Resampling,
    State,
    SystematicResampling,
)
from semgrid_edu.occupancy.steps import move, predict, resample, transition_matrix, update
from semgrid_edu.occupancy.walls import Walls
from semgrid_edu.occupancy.world import CmcdotParams, WorldModel

__all__ = [
    "N_STATES",
    "Belief",
    "Bof",
    "BofParams",
    "BofState",
    "Cmcdot",
    "CmcdotParams",
    "DriveTracker",
    "Evidence",
    "FilterState",
    "LogOddsGrid",
    "LogOddsParams",
    "Measurement",
    "Particles",
    "PlanarMotion",
    "Resampling",
    "Scan",
    "Sensor",
    "SensorModel",
    "State",
    "SystematicResampling",
    "VelocityLattice",
    "Walls",
    "WorldModel",
    "bof_move",
    "bof_predict",
    "bof_update",
    "bof_velocity",
    "log_odds",
    "move",
    "predict",
    "probability",
    "resample",
    "scan_evidence",
    "smear_area",
    "track_drive",
    "transition_matrix",
    "update",
    "update_log_odds",
]
