"""The paper's data sets: KITTI tracking with the labels of Zhang et al., and SYNTHIA (section 4).

Importing this package registers the reader "synthia" for dataset.json.
"""

from semgrid_edu.datasets.index import READERS, Reader
from semgrid_edu.workshop.paper.datasets.kitti_tracking import KittiTrackingRun, ZhangDrive, ZhangLabels
from semgrid_edu.workshop.paper.datasets.synthia import SynthiaSequence

__all__ = ["KittiTrackingRun", "SynthiaSequence", "ZhangDrive", "ZhangLabels"]

READERS["synthia"] = Reader(SynthiaSequence)
