"""Drawings of networks: the shapes are those of the maps inside, by the rules of halving."""

import matplotlib.pyplot as plt
import pytest
import torch
from worlds import lecture_07_drawn as drawn

from semgrid_edu.networks import build_segmenter


@pytest.fixture
def image():
    return torch.rand(1, 3, 64, 96)


def test_segnet_comes_back_level_by_level(image):
    maps, over, _ = drawn.draw_segnet(build_segmenter("segnet", 14, "compact").eval(), image)
    shapes = [one.shape for one in maps]
    assert shapes[:6] == [(3, 64, 96), (16, 64, 96), (32, 32, 48), (48, 16, 24), (64, 8, 12), (64, 4, 6)]
    assert shapes[6:] == [(48, 8, 12), (32, 16, 24), (16, 32, 48), (14, 64, 96)]
    assert all(shapes[start][1:] == shapes[end][1:] for start, end in over)


def test_fcn_adds_scores_of_equal_size(image):
    maps, over, _ = drawn.draw_fcn(build_segmenter("fcn", 14, "compact").eval(), image)
    assert [one.shape[1] for one in maps] == [64, 32, 16, 8, 4, 2, 2, 2, 4, 8, 64]
    assert [maps[end].shape for _, end in over] == [(14, 4, 6), (14, 8, 12)]
    assert all(maps[start].shape[1:] == maps[end].shape[1:] for start, end in over)


def test_deeplab_halves_three_times(image):
    maps, _, _ = drawn.draw_deeplab(build_segmenter("deeplab", 14, "compact").eval(), image)
    assert [one.shape[1] for one in maps] == [64, 32, 16, 8, 8, 8, 8, 64]


def test_each_map_has_its_shape_below(image):
    network = drawn.draw_segnet(build_segmenter("segnet", 14, "compact").eval(), image)
    _, ax = plt.subplots()
    drawn.draw_maps(network, ax, "SegNet")
    texts = [text.get_text() for text in ax.texts]
    assert all(f"{c} x\n{h} x {w}" in texts for _, (c, h, w), _ in network.maps)
