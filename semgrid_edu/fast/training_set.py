"""Frames to train on whose occupancy grids are made by the compiled filter."""

from semgrid_edu.datasets import training_set as book
from semgrid_edu.fast.occupancy.cmcdot import track_drive


class TrainingSet(book.TrainingSet):
    """The labelled frames of a data set. Parameters and errors are those of `TrainingSet`."""

    track = staticmethod(track_drive)
