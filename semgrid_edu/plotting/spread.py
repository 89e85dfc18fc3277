"""The spread of velocities: a distribution as points, its mean and its covariance as an ellipse (section 3.2)."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.plotting.colours import velocity_colours


def velocity_spread(velocity: NDArray, weight: NDArray, ax: Axes | None = None) -> Axes:
    """Draw a distribution over velocities, such as that of one cell's particles.

    Each velocity is a point, whose area is its weight. A cross marks the mean. The ellipse around it has half-axes of
    two standard deviations.

    Parameters
    ----------
    velocity : (N, 2) float
        Velocities forward and to the left, m/s.
    weight : (N,) float
        Their weights, not negative and not all zero; they need not sum to 1.
    ax : Axes, optional
        Axes to draw into.

    Returns
    -------
    Axes

    Raises
    ------
    ArgumentError
        When the shapes don't match, a velocity isn't finite, or the weights are negative, all zero or not finite.
    """
    velocity, weight = np.asarray(velocity, dtype=np.float64), np.asarray(weight, dtype=np.float64)
    if velocity.shape != (*weight.shape, 2) or weight.ndim != 1:
        raise ArgumentError("velocity", f"(N, 2) for weights of shape {weight.shape}", f"shape {velocity.shape}")
    if not (weight >= 0).all() or not 0 < weight.sum() < np.inf:
        raise ArgumentError("weight", "finite numbers >= 0, not all zero", weight)
    if not np.isfinite(velocity).all():
        raise ArgumentError("velocity", "finite numbers", velocity)
    if ax is None:
        _, ax = plt.subplots(figsize=(4, 4), layout="constrained")
    share = weight / weight.sum()
    area = 150 * min(1, 60 / len(share)) * share / share.max()
    ax.scatter(*velocity[:, ::-1].T, s=area, c=velocity_colours(velocity.T) / 255, alpha=0.7, linewidths=0)
    mean = share @ velocity
    away = velocity - mean
    velocity_ellipse(mean, np.einsum("n,ni,nj->ij", share, away, away), ax)
    ax.set(xlabel="velocity to the left [m/s]", ylabel="velocity forward [m/s]", aspect="equal")
    if not ax.xaxis_inverted():
        ax.invert_xaxis()
    return ax


def velocity_ellipse(mean: NDArray, covariance: NDArray, ax: Axes) -> Axes:
    """Mark a mean velocity with a cross, and its uncertainty with an ellipse of two standard deviations.

    Parameters
    ----------
    mean : (2,) float
        Mean velocity forward and to the left, m/s.
    covariance : (2, 2) float
        Covariance of the velocity forward and to the left, m^2/s^2.
    ax : Axes
        Axes from `velocity_spread`: velocity to the left across, forward up.

    Returns
    -------
    Axes

    Raises
    ------
    ArgumentError
        When `covariance` isn't symmetric and positive semi-definite.
    """
    covariance = np.asarray(covariance, dtype=np.float64)
    variance, axes = np.linalg.eigh(covariance) if covariance.shape == (2, 2) else ([np.nan], None)
    rounding = 1e-5 * (np.sum(np.square(mean)) + np.max(variance))  # E[v v^T] - mean mean^T in single precision
    if np.shape(mean) != (2,) or not np.all(np.array(variance) >= -rounding):
        raise ArgumentError("covariance", "(2, 2), symmetric, not negative, beside a mean (2,)", covariance)
    long, short = 4 * np.sqrt(np.maximum(variance[::-1], 0))
    angle = np.degrees(np.arctan2(axes[0, 1], axes[1, 1]))
    ax.add_patch(Ellipse((mean[1], mean[0]), long, short, angle=angle, fill=False, edgecolor="0.2", linewidth=1.2))
    ax.plot(mean[1], mean[0], "+", color="0.2", markersize=9)
    return ax
