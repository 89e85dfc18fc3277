"""What the demo's tests share: a tiny drive, a network, its results, and the stories of some cells."""

from functools import cache
from types import SimpleNamespace

import pytest
import torch
from tiny_drive import DATE, write_tiny_drive
from torch import nn

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.networks import Architecture, build_net
from semgrid_edu.pipeline import Stages, run_pipeline
from semgrid_edu.workshop.demo import cell_story, record, run
from semgrid_edu.workshop.demo import stories as stories_module
from semgrid_edu.workshop.demo.stories import frame_story

CELLS = [(81, 31), (82, 25), (120, 33), (30, 5), (0, 0), (141, 61)]
"""On the wall of the tiny drive, before it, on the road, far away, and two corners."""


@pytest.fixture(scope="session")
def make_net():
    """Build networks in evaluation mode whose batch normalisations do something."""

    def build(camera, **changes):
        net = build_net(Architecture(**changes), camera, seed=3).eval()
        generator = torch.Generator().manual_seed(5)
        for module in net.fusion.modules():
            if isinstance(module, nn.BatchNorm2d | nn.BatchNorm3d):
                module.running_mean.normal_(generator=generator)
                module.running_var.uniform_(0.5, 2, generator=generator)
                module.bias.data.normal_(generator=generator)
        return net

    return build


@pytest.fixture(scope="session")
def last_labelled(tmp_path_factory):
    """A drive of three frames, the last of which is labelled."""
    root = tmp_path_factory.mktemp("drive")
    write_tiny_drive(root, labelled=(2,))
    return KittiRawDrive(root, DATE, "0001")


@pytest.fixture(scope="session")
def drive(tmp_path_factory):
    """A drive of three frames, the last two of which are labelled."""
    root = tmp_path_factory.mktemp("drive")
    write_tiny_drive(root, labelled=(1, 2))
    return KittiRawDrive(root, DATE, "0001")


@pytest.fixture(scope="session")
def net(last_labelled, make_net):
    return make_net(last_labelled.camera)


@pytest.fixture(scope="session")
def told(last_labelled, net):
    """The results of all frames, with the filter's steps and with memory."""
    return list(run_pipeline(last_labelled, Stages.fast(net, keep_steps=True, memory=True)))


@pytest.fixture(scope="session")
def story_maps(told, net):
    """The stories of all cells of the last frame."""
    return frame_story(told[-1], net, [(one.frame, one.grid.argmax(axis=0)) for one in told[:-1]])


@pytest.fixture(scope="session")
def stories(told, net, story_maps):
    """The stories of `CELLS`, from the maps that have been computed already."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stories_module, "frame_story", lambda *_: story_maps)
        return [cell_story(told[-1], cell, net, past=told[:-1]) for cell in CELLS]


@pytest.fixture(params=range(len(CELLS)), ids=[str(cell) for cell in CELLS])
def story(request, stories):
    return stories[request.param]


@pytest.fixture(scope="session")
def first_details():
    """The maps of the first frame that asks for some, for all that ask later; they are packed once."""
    found, original = [], record.frame_details

    def details(*arguments):
        if not found:
            maps = original(*arguments)
            found.append(SimpleNamespace(layout=maps.layout, packed=cache(maps.packed)))
        return found[0]

    return details


@pytest.fixture(scope="module")
def few_stories(first_details):
    """All frames tell the stories of one frame's cells, because the stories take most of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(record, "frame_details", first_details)
        yield


@pytest.fixture
def no_overview(monkeypatch):
    """Leave out the picture, which takes longer than the page of a tiny drive, where no test looks at it."""
    monkeypatch.setattr(run, "save_overview", lambda *_: None)
