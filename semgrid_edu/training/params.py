"""The parameters of a training run: stages, steps, rates (paper, section 4.1)."""

import math
from dataclasses import dataclass

from semgrid_edu.errors import check_fields, types_named

OPTIMISERS = ("sgd", "adamw")


@dataclass(frozen=True)
class TrainingParams:
    """How the network is trained: first the image network on image labels, then the whole network on grids.

    The first stage replaces the paper's ImageNet weights.

    Parameters
    ----------
    image_iterations, grid_iterations : int
        Number of steps of the first and of the second stage; the paper stops at 2000.
    batch_size : int
        Frames per step; 6 in the paper.
    learning_rate : float
        The rate at the start of each stage, from which it falls to zero along half a cosine. The paper's 1e-3
        fine-tunes ImageNet weights. Our networks start from random weights and normalise in every layer, so they allow
        much larger steps.
    momentum : float
        The fraction of the last step that is added to the next; 0.9 in the paper.
    optimiser : str
        "sgd" for gradient descent with momentum, as in the paper; "adamw", which scales the step of each weight by its
        recent gradients (Loshchilov and Hutter, 2019) and keeps PyTorch's momenta and decay.
    encoder_rate : float
        The rate of the weights that ImageNet taught, as a fraction of `learning_rate`: they need smaller steps than
        fresh weights.
    weight_limit : float
        Largest weight of a class, see `median_frequency_weights`. Without a limit, a cell of signage counts three
        hundred times as much as a cell of unknown-unobserved in minikitti, and a handful of cells decides the loss.
    jitter : float
        How much brightness and contrast of the images vary, as a fraction of their range (data augmentation), because
        142 frames show few kinds of light.
    tint : float
        How much red, green and blue vary independently, as a fraction, because light and cameras differ between
        streets.
    end_to_end : bool
        Whether the loss on the grid teaches the image network too. If not, training has two separate stages, as in the
        authors' earlier work, and the second stage doesn't change the image network.
    mirror : bool
        Whether a random half of the batches is mirrored: a street with left and right exchanged is just as likely.
    """

    image_iterations: int = 2000
    grid_iterations: int = 2000
    batch_size: int = 6
    learning_rate: float = 0.05
    momentum: float = 0.9
    optimiser: str = "sgd"
    encoder_rate: float = 1.0
    weight_limit: float = 4.0
    jitter: float = 0.2
    tint: float = 0.0
    end_to_end: bool = True
    mirror: bool = True

    @types_named
    def __post_init__(self) -> None:
        """Check that a network can be trained with these numbers."""
        check_fields(self, "0 or more", lambda steps: steps >= 0, "image_iterations", "grid_iterations")
        check_fields(self, "at least one frame", lambda frames: frames >= 1, "batch_size")
        check_fields(self, "a positive number", lambda rate: 0 < rate < math.inf, "learning_rate")
        check_fields(self, f"one of {', '.join(OPTIMISERS)}", lambda name: name in OPTIMISERS, "optimiser")
        check_fields(self, "a share from 0 to 1", lambda share: 0 <= share <= 1, "encoder_rate")
        check_fields(self, "a share from 0 to below 1", lambda share: 0 <= share < 1, "momentum")
        check_fields(self, "1 or more", lambda limit: limit >= 1, "weight_limit")
        check_fields(self, "a share of at least 0", lambda share: 0 <= share < math.inf, "jitter")
        check_fields(self, "a share from 0 to 1", lambda share: 0 <= share <= 1, "tint")

    @property
    def iterations(self) -> int:
        """Number of steps of both stages together."""
        return self.image_iterations + self.grid_iterations

    @property
    def stages(self) -> list[str]:
        """The stages that have steps: "image", "grid" or both."""
        steps = {"image": self.image_iterations, "grid": self.grid_iterations}
        return [stage for stage, number in steps.items() if number]

    def stage(self, iteration: int) -> tuple[str, float]:
        """Return the stage that an iteration belongs to, and the learning rate of its step.

        Parameters
        ----------
        iteration : int
            Number of the iteration, counted from 0 over both stages.

        Returns
        -------
        stage : str
            "image" or "grid".
        learning_rate : float
            The rate, which falls to zero along half a cosine in each stage.
        """
        if iteration < self.image_iterations:
            stage = "image"
            done = iteration / self.image_iterations
        else:
            stage = "grid"
            done = (iteration - self.image_iterations) / self.grid_iterations
        return stage, self.learning_rate * (1 + math.cos(math.pi * done)) / 2
