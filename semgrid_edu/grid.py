"""The bird's-eye grid: where its cells are, and which cell contains a point (paper, section 4.1)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError, types_named


@dataclass(frozen=True)
class GridSpec:
    """A rectangle of square cells in the grid frame: x forward, y left, origin on the ground below the LIDAR.

    Arrays over it are maps seen from above with forward up: row 0 is the farthest ahead, column 0 the leftmost. The
    centre of cell (r, c) is at x = x_max - (r + 1/2) cell, y = y_max - (c + 1/2) cell.

    Parameters
    ----------
    x_min, x_max, y_min, y_max : float
        The borders in the grid frame, metres. Both sides must be whole numbers of cells.
    cell : float
        The side of a cell, metres.

    Examples
    --------
    >>> spec = GridSpec(x_min=0, x_max=4, y_min=-1, y_max=1, cell=1)
    >>> spec.shape
    (4, 2)
    >>> spec.centers()[0, 0]
    array([3.5, 0.5])
    """

    x_min: float
    x_max: float
    y_min: float
    y_max: float
    cell: float

    @types_named
    def __post_init__(self) -> None:
        """Check that borders and cell are finite, and that each side is a whole number of cells."""
        if not (np.isfinite(self.cell) and self.cell > 0):
            raise ArgumentError("cell", "a positive size in metres", self.cell)
        for axis, low, high in (("x", self.x_min, self.x_max), ("y", self.y_min, self.y_max)):
            if not (np.isfinite(low) and np.isfinite(high) and low < high):
                raise ArgumentError(f"{axis}_min, {axis}_max", "finite metres, the smaller first", (low, high))
            cells = (high - low) / self.cell
            if abs(cells - round(cells)) > 1e-6:
                raise ArgumentError(f"{axis}_max - {axis}_min", f"a whole number of {self.cell} m cells", high - low)

    @classmethod
    def paper(cls) -> "GridSpec":
        """Return the paper's grid (section 4.1): 71 m ahead, 31 m wide, 0.2 m cells, (355, 155).

        The paper gives the size of the grid, but not its position. Ours begins at the LIDAR, because the camera looks
        ahead.
        """
        return cls(x_min=0.0, x_max=71.0, y_min=-15.5, y_max=15.5, cell=0.2)

    @classmethod
    def compact(cls) -> "GridSpec":
        """Return the course's default: the paper's extent in 0.5 m cells, (142, 62)."""
        return cls(x_min=0.0, x_max=71.0, y_min=-15.5, y_max=15.5, cell=0.5)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns, (H, W)."""
        return round((self.x_max - self.x_min) / self.cell), round((self.y_max - self.y_min) / self.cell)

    @property
    def corner(self) -> tuple[float, float, float]:
        """x_max, y_max and cell as floats, because numba compiles a loop again for each mixture of ints and floats."""
        return float(self.x_max), float(self.y_max), float(self.cell)

    def centers(self) -> NDArray[np.float64]:
        """Return x and y of the centre of every cell in the grid frame, (H, W, 2), metres."""
        height, width = self.shape
        x = self.x_max - (np.arange(height) + 0.5) * self.cell
        y = self.y_max - (np.arange(width) + 0.5) * self.cell
        return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)

    def distances(self) -> NDArray[np.float64]:
        """Return the distance of every cell's centre from the origin of the grid frame, (H, W), metres."""
        return np.hypot(*np.moveaxis(self.centers(), -1, 0))

    def cells(self, xy: NDArray) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Find the cell that contains each point.

        Parameters
        ----------
        xy : (N, 2+) float
            Points in the grid frame, metres; further columns are ignored. A point with a NaN is in no cell.

        Returns
        -------
        rows, cols : (N,) int64
            The cell of each point; 0 for a point outside, so use them only where `inside` holds.
        inside : (N,) bool
            Whether the point is in the grid, which includes the borders x_max and y_max, but not x_min and y_min.
        """
        xy = np.asarray(xy)
        if xy.ndim != 2 or xy.shape[1] < 2:
            raise ArgumentError("xy", "points of shape (N, 2)", f"shape {xy.shape}")
        height, width = self.shape
        row = np.floor((self.x_max - xy[:, 0].astype(np.float64)) / self.cell)
        col = np.floor((self.y_max - xy[:, 1].astype(np.float64)) / self.cell)
        inside = (row >= 0) & (row < height) & (col >= 0) & (col < width)
        return np.where(inside, row, 0).astype(np.int64), np.where(inside, col, 0).astype(np.int64), inside
