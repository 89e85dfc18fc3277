"""The stages of the system by their fast twins."""

from dataclasses import replace

from numpy.typing import NDArray

from semgrid_edu.crf import CrfParams
from semgrid_edu.fast.crf.mean_field import mean_field
from semgrid_edu.fast.networks import with_fast_sampler
from semgrid_edu.fast.occupancy.cmcdot import DriveTracker
from semgrid_edu.memory import MemoryParams
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.occupancy import CmcdotParams
from semgrid_edu.stages.stages import Stages, network_stages


def fast_stages(
    net: SemanticGridNet,
    occupancy: CmcdotParams | None = None,
    crf: CrfParams | None = None,
    seed: int = 0,
    keep_steps: bool = False,
    memory: bool | MemoryParams = False,
) -> Stages:
    """Return the book's stages with a compiled filter, a frozen sampler and a compiled CRF.

    Parameters and errors are those of `Stages.of`.
    """
    spec = net.need_architecture().grid
    crf = crf or CrfParams.for_cells(spec.cell)

    def refine(log_g: NDArray, o: NDArray) -> NDArray:
        return mean_field(-log_g, o, crf)

    track = DriveTracker(spec, occupancy, seed, keep_steps)
    return replace(network_stages(with_fast_sampler(net), memory), track=track, refine=refine)
