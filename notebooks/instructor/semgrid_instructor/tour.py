"""Hidden tests of exercise 00, the tour: the package itself is the reference."""

from collections.abc import Callable

import numpy as np

from semgrid_edu.camera import Camera, project, rigid_transform, transform_points
from semgrid_edu.grid import GridSpec
from semgrid_edu.metrics import class_accuracy, frequency_weighted_iou, pixel_accuracy
from semgrid_edu.workshop.course.answers import answer_array
from semgrid_instructor import close, generator, hidden, in_any_order, keeping


@hidden
def check_cell_of(cell_of: Callable) -> None:
    """Points anywhere in the cells of a grid that also reaches behind the vehicle."""
    rng = generator(1)
    spec = GridSpec(x_min=-10, x_max=30, y_min=-6, y_max=14, cell=0.2)
    centers = spec.centers()
    for row, col in in_any_order(rng.integers(0, spec.shape, size=(40, 2))):
        x, y = centers[row, col] + rng.uniform(-0.09, 0.09, size=2)
        got = answer_array(cell_of(float(x), float(y), spec.x_max, spec.y_max, spec.cell))
        assert got.shape == (2,), "return two numbers, row and column"
        assert got[0] == row, "wrong row (behind the vehicle x is negative; cells need not be 0.5 m)"
        assert got[1] == col, "wrong column (right of the vehicle y is negative; the grid need not be symmetric)"


@hidden
@keeping
def check_bayes_update(bayes_update: Callable) -> None:
    """Random beliefs over a grid of another shape, with cells that are certain."""
    rng = generator(2)
    belief = rng.dirichlet(np.ones(4), size=(5, 7)).transpose(2, 0, 1)
    belief[:, 3, 6] = [0, 1, 0, 0]
    likelihood = rng.uniform(0.05, 1, size=belief.shape)
    got = answer_array(bayes_update(belief.copy(), likelihood.copy()))
    assert got.shape == belief.shape, "another shape"
    assert close(got.sum(axis=0), 1), "the states of some cells don't sum to 1"
    assert close(got[:, 3, 6], belief[:, 3, 6]), "a cell that is certain must stay certain"
    product = belief * likelihood
    assert close(got, product / product.sum(axis=0)), "sums are right, values are not"


def _rig(seed: int) -> tuple[np.ndarray, np.ndarray, np.random.Generator]:
    """Return a camera matrix, T_camera_from_grid of a camera that looks ahead and a little aside, and the generator."""
    rng = generator(seed)
    K = np.array([[700.0, 0, 610], [0, 720, 170], [0, 0, 1]])
    ahead = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
    a = 0.1
    aside = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    return K, rigid_transform(aside @ ahead, np.array([0.06, 1.65, -0.27])), rng


@hidden
def check_pixel_of(pixel_of: Callable) -> None:
    """Try a camera with two focal lengths that looks a little aside."""
    K, T_camera_from_grid, rng = _rig(3)
    points = np.array(in_any_order(rng.uniform([4, -5, 0], [60, 5, 3], size=(30, 3))))
    camera = Camera(K, np.eye(4), size=(375, 1242))
    expected, _ = project(transform_points(T_camera_from_grid, points), camera)
    got = np.array([answer_array(pixel_of(point, K, T_camera_from_grid)) for point in points])
    assert got.shape == expected.shape, "return two numbers, u and v"
    assert close(got, expected, atol=1e-3), "other pixels"


@hidden
def check_pixel_behind(pixel_of: Callable) -> None:
    """Points behind the camera, and one in its own plane, where Z is zero.

    They lie far to the left, so that they are behind by the inverse transform as well: check_pixel_of judges that.
    """
    K, T_camera_from_grid, rng = _rig(4)
    points = rng.uniform([-60, 3, 0], [-2, 5, 3], size=(10, 3))
    ahead = np.array([[0.0, -1, 0, 0], [0, 0, -1, 1.5], [1, 0, 0, 0], [0, 0, 0, 1]])
    cases = [(np.array([0.0, 2.0, 1.0]), ahead, "beside")]
    for point in points:
        cases += [(point, T_camera_from_grid, "behind"), (-point, T_camera_from_grid, "ahead")]
    got = {"behind": [], "ahead": [], "beside": []}
    for point, T, where in in_any_order(cases):
        got[where].append(answer_array(pixel_of(point, K, T)))
    assert np.isfinite(got["ahead"]).any(), "no point has a pixel, on whatever side of the camera it is"
    assert np.isnan(got["behind"]).all(), "Z < 0, yet a pixel"
    assert np.isnan(got["beside"]).all(), "Z = 0: a point in the camera's own plane has no pixel"


@hidden
def check_accuracies(accuracies: Callable) -> None:
    """Random confusion over fourteen classes, three of them without truth, one never found."""
    rng = generator(5)
    for confusion in in_any_order(rng.integers(0, 50, size=(5, 14, 14))):
        confusion[[2, 7, 13]] = 0
        confusion[4, 4] = 0
        pixel, per_class = answer_array(accuracies(confusion.copy()))
        assert close(pixel, pixel_accuracy(confusion)), "wrong pixel accuracy"
        assert close(per_class, class_accuracy(confusion)), "wrong class accuracy (some classes have no truth)"


@hidden
@keeping
def check_fm_iou(fm_iou: Callable) -> None:
    """Random confusion: classes without truth, one of them claimed, one never found, and one that never occurs."""
    rng = generator(6)
    for confusion in in_any_order(rng.integers(0, 50, size=(5, 14, 15))):
        confusion[[2, 7, 13]] = 0
        confusion[:, 7] = 0
        confusion[4, 4] = 0
        found = answer_array(fm_iou(confusion.copy()))
        square = np.zeros((15, 15), int)  # no claim as a class that no cell is of
        square[:14] = confusion
        assert close(found, frequency_weighted_iou(square)), "wrong FmIoU (some classes have no truth)"
