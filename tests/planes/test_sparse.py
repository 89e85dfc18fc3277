import numpy as np
import torch
from scipy.sparse import block_diag, random_array

from semgrid_edu.planes.sparse import SparseMatrix, SparseProduct, bilinear_matrix


def _random_matrix():
    return random_array((30, 20), density=0.1, format="csr", dtype=np.float32, rng=np.random.default_rng(0))


def test_the_four_weights_of_a_visible_point_sum_to_one():
    rng = np.random.default_rng(1)
    pixels, visible = rng.uniform(0, 1, (2, 5, 6, 2)) * (8, 6), rng.random((2, 5, 6)) < 0.7
    matrix = bilinear_matrix(pixels, visible, (7, 9))
    assert matrix.shape == (60, 63)
    np.testing.assert_allclose(matrix.sum(axis=1), visible.ravel(), atol=1e-6)
    # The mean of the pixels' places by these weights is the point's place again.
    v, u = np.divmod(np.arange(63), 9)
    np.testing.assert_allclose((matrix @ np.stack([u, v], axis=1))[visible.ravel()], pixels[visible], atol=1e-5)


def test_products_are_those_of_scipy():
    matrix = _random_matrix()
    assert (np.diff(matrix.indptr) == 0).any()  # empty rows among them
    x = torch.randn(20, 3, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(SparseMatrix.from_scipy(matrix).multiply(x), torch.from_numpy(matrix @ x.numpy()))


def test_blocks_along_a_diagonal_are_those_of_scipy():
    matrix = _random_matrix()
    x = torch.randn(60, 3, generator=torch.Generator().manual_seed(0))
    product = SparseMatrix.from_scipy(matrix).block_diagonal(3, n_columns=20).multiply(x)
    torch.testing.assert_close(product, torch.from_numpy(block_diag([matrix] * 3) @ x.numpy()))


def test_the_gradient_of_a_product_is_that_by_the_transpose():
    matrix = _random_matrix()
    x = torch.zeros(20, 3, requires_grad=True)
    grad = torch.randn(30, 3, generator=torch.Generator().manual_seed(1))
    SparseProduct.apply(x, SparseMatrix.from_scipy(matrix), SparseMatrix.from_scipy(matrix.T.tocsr())).backward(grad)
    torch.testing.assert_close(x.grad, torch.from_numpy(matrix.T @ grad.numpy()))
