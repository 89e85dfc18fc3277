"""How the network learns: stages, steps, rates (paper, section 4.1)."""

import math
from dataclasses import dataclass

from semgrid_edu.errors import ArgumentError


@dataclass(frozen=True)
class TrainingParams:
    """How the network learns: first the image network on image labels, then all of it on the grid, end to end.

    The first stage stands in for the paper's ImageNet weights.

    Parameters
    ----------
    image_iterations, grid_iterations : int
        Of the two stages; the paper stops at 2000.
    batch_size : int
        Frames a step; the paper's 6.
    learning_rate : float
        At the start of each stage; it falls to zero along half a cosine. The paper's 1e-3 refines weights
        that come from ImageNet; ours start at random, normalised in every layer, and stand far more.
    momentum : float
        The paper's 0.9.
    weight_limit : float
        Largest weight of a class, see `median_frequency_weights`. Without it a cell of signage counts three hundred
        times one of unknown-unobserved in minikitti, and the loss is made of a handful of cells.
    jitter : float
        How far brightness and contrast of the images vary, as a share: 142 frames teach little about light.
    end_to_end : bool
        Whether the grid teaches the image network too. If not, training has two separate stages, as in the
        authors' earlier work: the image network stays as the first one left it.
    mirror : bool
        Whether every other batch, by chance, is seen in a mirror: streets are as likely to be the other way round.

    Raises
    ------
    ArgumentError
        When nothing can be learnt with one of the numbers.
    """

    image_iterations: int = 2000
    grid_iterations: int = 2000
    batch_size: int = 6
    learning_rate: float = 0.05
    momentum: float = 0.9
    weight_limit: float = 4.0
    jitter: float = 0.2
    end_to_end: bool = True
    mirror: bool = True

    def __post_init__(self) -> None:
        """Refuse numbers that nothing can be learnt with."""
        for name, expected, fits in (
            ("image_iterations", "0 or more", self.image_iterations >= 0),
            ("grid_iterations", "0 or more", self.grid_iterations >= 0),
            ("batch_size", "at least one frame", self.batch_size >= 1),
            ("learning_rate", "a positive number", 0 < self.learning_rate < math.inf),
            ("momentum", "a share from 0 to below 1", 0 <= self.momentum < 1),
            ("weight_limit", "1 or more", self.weight_limit >= 1),
            ("jitter", "a share of at least 0", 0 <= self.jitter < math.inf),
        ):
            if not fits:
                raise ArgumentError(name, expected, getattr(self, name))

    @property
    def iterations(self) -> int:
        """Of both stages together."""
        return self.image_iterations + self.grid_iterations

    def stage(self, iteration: int) -> tuple[str, float]:
        """Return the stage that an iteration is in, "image" or "grid", and its learning rate."""
        if iteration < self.image_iterations:
            stage, done = "image", iteration / self.image_iterations
        else:
            stage, done = "grid", (iteration - self.image_iterations) / self.grid_iterations
        return stage, self.learning_rate * (1 + math.cos(math.pi * done)) / 2
