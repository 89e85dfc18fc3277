"""Training: batches, loss, loop, checkpoints, devices and processes (paper, section 4.1)."""

from semgrid_edu.training.checkpoint import CHECKPOINT
from semgrid_edu.training.loop import train
from semgrid_edu.training.loss import Objective, median_frequency_weights, weighted_cross_entropy
from semgrid_edu.training.params import TrainingParams

__all__ = ["CHECKPOINT", "Objective", "TrainingParams", "median_frequency_weights", "train", "weighted_cross_entropy"]
