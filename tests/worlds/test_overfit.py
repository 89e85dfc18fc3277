"""Four frames learnt by heart: small networks do it in seconds, and the experiment reports what it did."""

from dataclasses import replace

import pytest
import torch
from sklearn.metrics import accuracy_score
from tiny_streets import CAMERA, SMALL, tiny_streets
from worlds import lecture_08_overfit as overfit

from semgrid_edu.labels import IGNORE
from semgrid_edu.networks import SEGMENTERS, build_net
from semgrid_edu.training.batches import draw_batch


@pytest.fixture(autouse=True)
def one_thread():
    """Networks this small only wait for a second one."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(scope="module")
def streets():
    return tiny_streets()


@pytest.mark.parametrize("segmenter", SEGMENTERS)
def test_every_network_learns_four_streets_by_heart(streets, segmenter):
    net = build_net(replace(SMALL, segmenter=segmenter), CAMERA)
    result = overfit.learn_by_heart(net, streets, replace(overfit.PARAMS, grid_iterations=60), seed=0)
    found = result["pixel accuracy"]
    # EfficientNet's running statistics are means over a hundred steps, as published: 60 don't fill them.
    assert min([found["training"]] if segmenter == "efficientnet" else found.values()) >= 0.99
    assert result["iterations"] == 60
    assert len(result["losses"]) == 3
    assert result["losses"][-1] < 0.05 * result["losses"][0]


def test_accuracy_is_of_labelled_cells_in_either_mode(streets):
    net = build_net(SMALL, CAMERA).eval()
    streets = [street._replace(truth=street.truth.clone()) for street in streets]
    streets[0].truth[:3] = IGNORE
    before = {name: tensor.clone() for name, tensor in net.state_dict().items()}
    image, occupancy, truth = (torch.stack([getattr(s, n) for s in streets]) for n in ("image", "occupancy", "truth"))
    found = [overfit.network_accuracy(net, streets, training) for training in (False, True)]
    assert not net.training
    assert all(torch.equal(before[name], tensor) for name, tensor in net.state_dict().items())
    labelled = truth != IGNORE
    with torch.no_grad():
        predicted = [net.train(training)(image / 255, occupancy).argmax(1) for training in (False, True)]
    assert found == [pytest.approx(accuracy_score(truth[labelled], p[labelled])) for p in predicted]
    assert found[0] != found[1]


def test_every_step_sees_the_frames_as_they_are(streets):
    for k in range(8):
        arguments = streets, overfit.PARAMS.batch_size, overfit.PARAMS.jitter, k, 0
        batch = draw_batch(*arguments, overfit.PARAMS.mirror)
        assert not batch.mirrored
        assert sorted(image.sum().item() for image in batch.frames.image) == pytest.approx(
            sorted((street.image / 255).sum().item() for street in streets)
        )
    assert any(draw_batch(streets, 4, 0.0, k, 0).mirrored for k in range(8))
