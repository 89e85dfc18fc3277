"""What all stories of cells on a page have in common: the grid, the camera, the planes, the classes, the CRF."""

from dataclasses import asdict, dataclass

from semgrid_edu.camera import Camera
from semgrid_edu.crf import CrfParams
from semgrid_edu.demo.details import PART_STEP, REACH_STEP, VERDICTS
from semgrid_edu.labels import LABEL_SETS
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.plotting import STATE_COLOURS


@dataclass(frozen=True)
class StoryData:
    """What the page's script needs besides the maps of each frame, as plain numbers for JSON.

    Parameters
    ----------
    grid : dict of str to float
        The fields of `GridSpec`, and "rows" and "cols".
    camera : dict of str to list of float
        "K" and "T_camera_from_grid" row by row, and "size" (h, w), of the camera at the size of the drive's images.
    heights : list of float
        Heights of the planes, metres.
    names : list of str
        Names of the classes.
    colours : dict of str to list of list of int
        Colours of the "classes" and of the "states".
    crf : dict of str to float or str
        The fields of `CrfParams`.
    layout : dict of str to int
        Names of the maps of a frame, in their order, and how many there are of each.
    verdicts : list of str
        What a scan can say of a cell.
    steps : dict of str to float
        How the numbers are rounded: "part" of a score, and "reach" of a beam in metres.
    """

    grid: dict[str, float]
    camera: dict[str, list[float]]
    heights: list[float]
    names: list[str]
    colours: dict[str, list[list[int]]]
    crf: dict[str, float | str]
    layout: dict[str, int]
    verdicts: list[str]
    steps: dict[str, float]

    @classmethod
    def of(cls, net: SemanticGridNet, camera: Camera, layout: dict[str, int]) -> "StoryData":
        """Gather it from a network and a camera.

        Parameters
        ----------
        net : SemanticGridNet
            The network of the package's results.
        camera : Camera
            The camera at the size of the drive's images.
        layout : dict of str to int
            The maps of a frame.

        Returns
        -------
        StoryData
            Plain numbers.
        """
        architecture = net.need_architecture()
        spec, label_set = architecture.grid, LABEL_SETS[architecture.label_set]
        matrices = {"K": camera.K, "T_camera_from_grid": camera.T_camera_from_grid}
        return cls(
            grid={**asdict(spec), "rows": spec.shape[0], "cols": spec.shape[1]},
            camera={**{name: matrix.ravel().tolist() for name, matrix in matrices.items()}, "size": list(camera.size)},
            heights=list(architecture.heights),
            names=list(label_set.names),
            colours={"classes": [list(c) for c in label_set.rgb], "states": [list(c) for c in STATE_COLOURS]},
            crf=asdict(CrfParams.for_cells(spec.cell)),
            layout=layout,
            verdicts=list(VERDICTS),
            steps={"part": PART_STEP, "reach": REACH_STEP},
        )
