import copy
import math
import resource
import shutil
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from lightning_fabric import Fabric
from safetensors.torch import load_file
from sklearn.metrics import accuracy_score
from tiny_streets import CAMERA, SMALL, Watched, kill, tiny_streets

from semgrid_edu.datasets.training_set import Mixture
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.networks import SEGMENTERS, SemanticGridNet, build_net
from semgrid_edu.storage.tensors import read_tensors, write_tensors
from semgrid_edu.training import TrainingParams, train
from semgrid_edu.training import loop as training
from semgrid_edu.training.batches import Batch, draw_batch, grid_logits, image_scores
from semgrid_edu.training.log import read_log
from semgrid_edu.training.loss import median_frequency_weights

ENDED = {"image_stage.safetensors", "log.csv", "weights.safetensors"}
QUICK = TrainingParams(image_iterations=3, grid_iterations=4, batch_size=2)


@pytest.fixture(autouse=True, scope="module")
def _one_thread():
    """Networks this small only wait for a second one."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(scope="module")
def streets():
    return tiny_streets()


# Batches


def test_each_pass_takes_every_frame_once_in_a_new_order(streets):
    frames, orders = [sample.truth.numpy().tobytes() for sample in streets], set()
    for epoch in range(5):
        batches = [draw_batch(streets, 2, 0.0, 2 * epoch + k, seed=0).frames.truth for k in range(2)]
        order = [frames.index(truth.numpy().tobytes()) for truth in torch.cat(batches)]
        assert sorted(order) == [0, 1, 2, 3]
        orders.add(tuple(order))
    assert len(orders) > 1


def test_a_batch_is_a_function_of_seed_and_step(streets):
    def image(iteration, seed):
        return draw_batch(streets, 2, 0.2, iteration, seed).frames.image

    assert torch.equal(image(5, 1), image(5, 1))
    assert not torch.equal(image(5, 1), image(6, 1))
    assert not torch.equal(image(5, 1), image(5, 2))


def test_each_colour_of_a_frame_varies_by_itself(streets):
    plain, tinted = (draw_batch(streets, 4, 0.0, 3, seed=0, tint=tint).frames.image for tint in (0.0, 0.3))
    shown = (plain > 0) & (tinted < 1)
    factors = [(tinted / plain)[frame, colour][shown[frame, colour]] for frame in range(4) for colour in range(3)]
    assert all(factor.max() - factor.min() < 1e-5 for factor in factors if len(factor))
    found = torch.stack([factor[0] for factor in factors if len(factor)])
    assert found.sub(1).abs().max() <= 0.3 + 1e-6
    assert len(found.unique()) == len(found) > 6


def test_each_frame_has_a_brightness_and_a_contrast_of_its_own(streets):
    """Fitted as a line through what a frame shows: at most a share `jitter` off, about the middle grey."""
    found = []
    for iteration in range(20):
        plain, varied = (draw_batch(streets, 4, jitter, iteration, seed=0).frames.image for jitter in (0.0, 0.2))
        assert varied.min() >= 0
        assert varied.max() <= 1
        for before, after in zip(plain - 0.5, varied - 0.5, strict=True):
            inside = (after.abs() < 0.5).numpy()
            found.append(np.polyfit(before.numpy()[inside], after.numpy()[inside], 1))
    contrast, brightness = np.transpose(found) - [[1], [0]]
    for values in (contrast, brightness):
        assert -0.2 <= values.min() < -0.15
        assert 0.15 < values.max() <= 0.2
    assert np.ptp(contrast.reshape(20, 4), axis=1).min() > 0  # in each batch
    assert abs(np.corrcoef(contrast, brightness)[0, 1]) < 0.3


def test_every_other_batch_is_mirrored_by_chance(streets):
    mirrored = [draw_batch(streets, 2, 0.0, iteration, seed=0).mirrored for iteration in range(200)]
    assert 80 <= sum(mirrored) <= 120
    assert not any(draw_batch(streets, 2, 0.0, iteration, seed=0, mirror=False).mirrored for iteration in range(20))


class _Function(torch.nn.Module):
    """A function in the place of a network's part."""

    def __init__(self, function):
        super().__init__()
        self.forward = function


def test_a_mirror_changes_what_the_networks_see_and_not_where_it_lies(streets):
    """Networks that answer each place by itself can't tell a mirror from the street."""
    frames, seen = draw_batch(streets, 2, 0.0, 0, seed=0).frames, []
    occupancy = torch.rand(frames.occupancy.shape, generator=torch.Generator().manual_seed(0))

    def answer(*maps):
        seen.append(maps)
        return sum(x.sum(1, keepdim=True) for x in maps)

    by_place = build_net(SMALL, CAMERA)
    by_place.segmenter = _Function(answer)
    by_place.fusion.reduce = _Function(lambda planes: planes.sum(dim=2, keepdim=True))
    by_place.fusion.conv_deconv = _Function(lambda x: answer(*x.split([1, 4], dim=1)))
    plain, mirrored = (grid_logits(by_place, Batch(frames._replace(occupancy=occupancy), m)) for m in (False, True))
    torch.testing.assert_close(plain, mirrored)
    for as_it_is, in_the_mirror in zip(seen[:2], seen[2:], strict=True):
        for x, y in zip(as_it_is, in_the_mirror, strict=True):
            assert torch.equal(x, y.flip(-1))
            assert not torch.equal(x, y)


# The loop


def test_the_learning_rate_falls_to_zero_along_half_a_cosine_in_each_stage():
    params = TrainingParams(image_iterations=12, grid_iterations=24, learning_rate=0.1)
    stages, rates = zip(*map(params.stage, range(params.iterations)), strict=True)
    assert stages == ("image",) * 12 + ("grid",) * 24
    # cos 60 degrees is a half, so that a third of the way takes a quarter of the rate.
    for start, length in ((0, 12), (12, 24)):
        third = [rates[start + k * length // 3] for k in range(3)]
        assert third == pytest.approx([0.1, 0.075, 0.025])
    assert 0 < rates[11] < 0.002
    assert 0 < rates[35] < 0.0005
    assert all(after < before for stage in (rates[:12], rates[12:]) for before, after in pairwise(stage))


def test_four_streets_are_learnt_by_heart(streets, tmp_path):
    params = TrainingParams(image_iterations=30, grid_iterations=60, batch_size=4, learning_rate=0.1, jitter=0.0)
    net = build_net(SMALL, CAMERA)
    train(net, streets, tmp_path, params)
    image, occupancy, truth = (
        torch.stack(x) for x in zip(*((s.image, s.occupancy, s.truth) for s in streets), strict=True)
    )
    assert accuracy_score(truth.ravel(), net(image / 255, occupancy).argmax(1).ravel()) >= 0.99


@pytest.mark.parametrize("end_to_end", [True, False])
def test_two_stages_leave_the_image_network_as_it_was(streets, tmp_path, end_to_end):
    train(build_net(SMALL, CAMERA), streets, tmp_path, replace(QUICK, end_to_end=end_to_end))
    before, after = (load_file(tmp_path / name) for name in ("image_stage.safetensors", "weights.safetensors"))
    for name, tensor in build_net(SMALL, CAMERA).fusion.state_dict().items():
        assert torch.equal(before[f"fusion.{name}"], tensor)  # not its turn yet
    kept = {name: torch.equal(before[name], after[name]) for name in before}
    assert all(kept[name] is not end_to_end for name in kept if name.startswith("segmenter"))
    assert not any(kept[name] for name in kept if name.startswith("fusion") and name.endswith("weight"))


def test_what_learnt_before_learns_after(streets, tmp_path):
    """Two-stage training stops the image network for a while; what the caller stopped stays so."""
    net = build_net(SMALL, CAMERA)
    stopped = net.fusion.reduce[0].weight.requires_grad_(False)
    before = stopped.clone()
    train(net, streets, tmp_path, replace(QUICK, end_to_end=False))
    assert [parameter for parameter in net.parameters() if not parameter.requires_grad] == [stopped]
    assert torch.equal(stopped, before)
    assert not any(module.training for module in net.modules())


@pytest.mark.parametrize("segmenter", SEGMENTERS)
def test_mixed_precision_convolves_in_half_and_keeps_the_rest(streets, tmp_path, segmenter):
    """What a GPU does, on the CPU: convolutions in bfloat16, weights and loss in float32."""
    half = Fabric(accelerator="cpu", devices=1, precision="bf16-mixed")
    net, types, sampled = build_net(replace(SMALL, segmenter=segmenter), CAMERA), set(), []
    for part in net.modules():
        if isinstance(part, torch.nn.Conv2d | torch.nn.Conv3d):
            part.register_forward_hook(lambda conv, x, y: types.add(y.dtype))
    net.sampler.register_forward_hook(lambda _, scores, planes: sampled.append((scores[0].dtype, planes.dtype)))
    train(net, streets, tmp_path, TrainingParams(1, 1, batch_size=2), fabric=half)
    assert types == {torch.bfloat16}
    assert all(scores == planes for scores, planes in sampled)  # float32 after an interpolation, which a CPU leaves so
    assert {parameter.dtype for parameter in net.parameters()} == {torch.float32}


def test_mixed_precision_learns_too(streets, tmp_path):
    half = Fabric(accelerator="cpu", devices=1, precision="bf16-mixed")
    params = TrainingParams(5, 8, batch_size=4, learning_rate=0.1)
    train(build_net(SMALL, CAMERA), streets, tmp_path, params, fabric=half)
    log = read_log(tmp_path / "log.csv")
    for stage in ("image", "grid"):
        loss = log.loss[log.stage == stage]
        assert loss[-1] < 0.6 * loss[0]


@pytest.mark.parametrize(
    ("field", "scores", "params"),
    [("labels", image_scores, QUICK), ("truth", grid_logits, replace(QUICK, image_iterations=0))],
    ids=["image", "grid"],
)
def test_the_first_loss_is_that_of_the_definition(streets, tmp_path, field, scores, params):
    """Weighted cross-entropy over what is labelled, written out; the log keeps six digits."""
    streets = [street._replace(**{field: getattr(street, field).clone()}) for street in streets]
    for street in streets:
        getattr(street, field)[::2, 3:] = IGNORE
    batch = draw_batch(streets, params.batch_size, params.jitter, 0, seed=0)
    g = scores(build_net(SMALL, CAMERA).train(), batch).softmax(dim=1).detach().numpy()
    alpha = median_frequency_weights([getattr(s, field).numpy() for s in streets], 14, params.weight_limit)
    above = below = 0.0
    for (frame, row, column), c in np.ndenumerate(getattr(batch.frames, field)):
        if c != IGNORE:
            above -= alpha[c] * math.log(g[frame, c, row, column])
            below += alpha[c]
    train(build_net(SMALL, CAMERA), streets, tmp_path, params)
    assert read_log(tmp_path / "log.csv").loss[0] == pytest.approx(above / below, rel=1e-5)


class _Part(list):
    """Streets that one camera has seen, as a `TrainingSet` holds them."""

    label_set = KITTI_14

    def __init__(self, streets, camera):
        super().__init__(streets)
        self.camera = camera

    __hash__ = object.__hash__


TURNED = replace(CAMERA, T_camera_from_lidar=CAMERA.T_camera_from_lidar @ np.diag([-1.0, -1, 1, 1]))
"""The same camera, looking back."""


def test_data_sets_take_turns_and_so_do_their_cameras(streets):
    front, back, other = (_Part(streets, CAMERA) for _ in range(3))
    mixture = Mixture([[front, back], [other]])
    turns = [mixture.turn(iteration) for iteration in range(8)]
    assert [part is other for part, _ in turns] == 4 * [False, True]
    assert [(part is back, turn) for part, turn in turns[::2]] == [(False, 0), (True, 0), (False, 1), (True, 1)]
    assert [turn for _, turn in turns[1::2]] == [0, 1, 2, 3]
    assert len(mixture) == 3 * len(streets) == len(list(mixture))
    assert mixture[len(streets)] is back[0]
    for beyond in (-1, len(mixture)):
        with pytest.raises(IndexError):
            mixture[beyond]


@pytest.mark.parametrize("data_sets", [[], [[]]])
def test_a_mixture_of_nothing_is_refused(data_sets):
    with pytest.raises(ArgumentError, match="data_sets: expected at least one data set"):
        Mixture(data_sets)


def test_each_camera_of_a_mixture_has_planes_of_its_own(streets, tmp_path):
    params = replace(QUICK, image_iterations=0, grid_iterations=2, batch_size=len(streets), mirror=False, jitter=0.0)
    trained = {}
    for name, data in {
        "alone": streets,
        "twice": Mixture([[_Part(streets, CAMERA)], [_Part(streets, CAMERA)]]),
        "turned": Mixture([[_Part(streets, CAMERA)], [_Part(streets, TURNED)]]),
    }.items():
        train(build_net(SMALL, CAMERA), data, tmp_path / name, params)
        trained[name] = load_file(tmp_path / name / "weights.safetensors")["fusion.reduce.0.weight"]
    torch.testing.assert_close(trained["alone"], trained["twice"], rtol=1e-3, atol=1e-4)
    assert (trained["turned"] - trained["alone"]).abs().max() > 1e-3


def test_a_step_goes_down_the_gradient_with_momentum(streets, tmp_path):
    """v <- 0.9 v + dL/dw, w <- w - rate v, written out.

    Two steps, of which the second has momentum. After more, a ReLU that rounding has flipped may count for more than
    the tolerance: both sides add up in another order.
    """
    params = replace(QUICK, image_iterations=0, grid_iterations=2, momentum=0.9, mirror=False)
    net = build_net(SMALL, CAMERA).train()
    before = {name: w.detach().clone() for name, w in net.named_parameters()}
    alpha = torch.from_numpy(median_frequency_weights([s.truth.numpy() for s in streets], 14, params.weight_limit))
    velocities = [torch.zeros_like(w) for w in net.parameters()]
    for k in range(2):
        batch = draw_batch(streets, params.batch_size, params.jitter, k, seed=2)._replace(mirrored=False)
        loss = F.cross_entropy(grid_logits(net, batch), batch.frames.truth.long(), weight=alpha.float())
        gradients = torch.autograd.grad(loss, list(net.parameters()))
        with torch.no_grad():
            for w, v, g in zip(net.parameters(), velocities, gradients, strict=True):
                w -= params.stage(k)[1] * v.mul_(0.9).add_(g)
    train(build_net(SMALL, CAMERA), streets, tmp_path, params, seed=2)
    trained = load_file(tmp_path / "weights.safetensors")
    for name, w in net.named_parameters():
        error, way = (trained[name] - w.detach()).norm(), (w.detach() - before[name]).norm()
        assert error <= 0.05 * way + 1e-6, name  # a bias before a normalisation doesn't move
    assert any(draw_batch(streets, 2, 0.0, k, seed=2).mirrored for k in range(2))  # had `mirror` not been off


def test_a_batch_without_labels_teaches_nothing(streets, tmp_path):
    """Its loss is 0, not 0/0: training goes on."""
    nothing = {name: torch.full_like(getattr(streets[0], name), IGNORE) for name in ("labels", "truth")}
    train(
        build_net(SMALL, CAMERA), [streets[0]._replace(**nothing), *streets[1:]], tmp_path, replace(QUICK, batch_size=1)
    )
    loss = read_log(tmp_path / "log.csv").loss
    drawn = [draw_batch(streets, 1, 0.0, k, seed=0).frames.truth[0] for k in range(QUICK.iterations)]
    unlabelled = np.array([truth.equal(streets[0].truth) for truth in drawn])
    assert 0 < unlabelled.sum() < len(loss)
    assert (loss[unlabelled] == 0).all()
    assert (loss[~unlabelled] > 0).all()


def _same_files(first, second):
    assert {path.name for path in first.iterdir()} == {path.name for path in second.iterdir()} == ENDED
    for name in ENDED:
        assert (first / name).read_bytes() == (second / name).read_bytes(), name


@pytest.mark.parametrize(
    "chosen", [{}, {"end_to_end": False, "optimiser": "adamw"}], ids=["end to end", "two stages with adamw"]
)
@pytest.mark.parametrize(
    ("checkpoint_every", "killed_after"),
    [(2, {2: "in the first stage", 5: "in the second stage"}), (3, {4: "between the stages"})],
    ids=["in the stages", "between the stages"],
)
def test_a_resumed_run_ends_with_the_same_bytes(streets, tmp_path, monkeypatch, checkpoint_every, killed_after, chosen):
    """A process killed after so many steps leaves what its folder holds then: no block ends, nothing is tidied up."""
    monkeypatch.setattr(training, "CHECKPOINT_EVERY", checkpoint_every)
    whole, params = tmp_path / "whole", replace(QUICK, **chosen)
    last = 3 * len(streets) + params.batch_size * params.iterations  # check, weights of two stages, steps

    def keep(reads):
        steps, begins = divmod(last - reads - 3 * len(streets), params.batch_size)
        if steps in killed_after and not begins:
            shutil.copytree(whole, tmp_path / killed_after[steps])

    train(build_net(SMALL, CAMERA, seed=1), Watched(streets, last, keep), whole, params, seed=1)
    for broken in (tmp_path / when for when in killed_after.values()):
        assert (broken / "checkpoint.safetensors").exists()
        train(build_net(SMALL, CAMERA, seed=9), streets, broken, params, seed=1, resume=True)
        _same_files(whole, broken)


def test_without_a_first_stage_images_need_no_labels(streets, tmp_path):
    unlabelled = [sample._replace(labels=torch.full_like(sample.labels, IGNORE)) for sample in streets]
    for name, frames in (("with", streets), ("without", unlabelled)):
        train(build_net(SMALL, CAMERA), frames, tmp_path / name, replace(QUICK, image_iterations=0))
    with_labels, without = ((tmp_path / name / "weights.safetensors").read_bytes() for name in ("with", "without"))
    assert with_labels == without


@pytest.mark.parametrize("optimiser", ["sgd", "adamw"])
def test_what_imagenet_taught_takes_smaller_steps(streets, tmp_path, optimiser):
    """With a rate of 0 the encoder stays, and everything else learns."""
    start = build_net(replace(SMALL, segmenter="efficientnet"), CAMERA)
    net = copy.deepcopy(start)
    params = TrainingParams(1, 1, batch_size=2, optimiser=optimiser, encoder_rate=0.0)
    train(net, streets, tmp_path, params)
    before = dict(start.named_parameters())
    moved = {name for name, weight in net.named_parameters() if not torch.equal(weight, before[name])}
    assert moved == {name for name in before if "backbone" not in name}


# What can go wrong


def test_a_loss_that_is_not_finite_stops_the_run(streets, tmp_path):
    wild = TrainingParams(image_iterations=50, grid_iterations=1, batch_size=2, learning_rate=1e30)
    with pytest.raises(ArgumentError, match="learning_rate: expected a rate that keeps the loss finite"):
        train(build_net(SMALL, CAMERA), streets, tmp_path, wild)
    assert not (tmp_path / "weights.safetensors").exists()


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"image_iterations": -1}, "image_iterations: expected 0 or more, found -1"),
        ({"grid_iterations": -1}, "grid_iterations: expected 0 or more, found -1"),
        ({"batch_size": 0}, "batch_size: expected at least one frame, found 0"),
        ({"learning_rate": 0.0}, "learning_rate: expected a positive number, found 0.0"),
        ({"learning_rate": math.nan}, "learning_rate: expected a positive number, found nan"),
        ({"optimiser": "adam"}, "optimiser: expected one of sgd, adamw, found adam"),
        ({"encoder_rate": 1.5}, "encoder_rate: expected a share from 0 to 1, found 1.5"),
        ({"momentum": 1.0}, "momentum: expected a share from 0 to below 1, found 1.0"),
        ({"weight_limit": 0.5}, "weight_limit: expected 1 or more, found 0.5"),
        ({"jitter": -0.1}, "jitter: expected a share of at least 0, found -0.1"),
        ({"tint": math.nan}, "tint: expected a share from 0 to 1, found nan"),
    ],
)
def test_numbers_that_nothing_is_learnt_with_are_refused(numbers, message):
    with pytest.raises(ArgumentError, match=f"^{message}$"):
        TrainingParams(**numbers)


def test_frames_that_do_not_fit_are_refused(streets, tmp_path):
    net = build_net(SMALL, CAMERA)
    cut = [sample._replace(image=sample.image[..., 1:]) for sample in streets]
    with pytest.raises(ArgumentError, match=r"image of shape \(3, 24, 80\), found \(3, 24, 79\)"):
        train(net, cut, tmp_path, QUICK)
    with pytest.raises(ArgumentError, match="at least one batch of 2 frames, found 1 frames"):
        train(net, streets[:1], tmp_path, QUICK)
    cut = [*streets[:3], streets[3]._replace(truth=streets[3].truth[:, :2])]
    with pytest.raises(ArgumentError, match=r"truth of shape \(24, 12\), found \(24, 2\) in frame 3"):
        train(net, cut, tmp_path, QUICK)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("field", ["labels", "truth"])
def test_wrong_labels_are_refused(streets, tmp_path, field):
    wrong = [*streets[:2], streets[2]._replace(**{field: torch.full_like(getattr(streets[2], field), 77)})]
    message = f"{field} of the dataset: expected classes 0..13 or 255, found 77..77 in map 2"
    with pytest.raises(ArgumentError, match=message):
        train(build_net(SMALL, CAMERA), wrong, tmp_path, QUICK)
    assert not list(tmp_path.iterdir())


def test_a_network_that_could_not_be_saved_is_not_trained(streets, tmp_path):
    net = build_net(SMALL, CAMERA)
    by_hand = SemanticGridNet(net.segmenter, net.sampler, net.n_classes)
    with pytest.raises(ArgumentError, match="net: expected a network of build_net"):
        train(by_hand, streets, tmp_path, QUICK)
    assert not list(tmp_path.iterdir())


def _killed(streets, folder, monkeypatch, architecture=SMALL):
    """A training that was killed in its fourth step and has kept a checkpoint after two."""
    monkeypatch.setattr(training, "CHECKPOINT_EVERY", 2)
    reads = 3 * len(streets) + 3 * QUICK.batch_size
    with pytest.raises(InterruptedError):
        train(build_net(architecture, CAMERA), Watched(streets, reads, kill), folder, QUICK)


def test_only_its_own_run_is_resumed(streets, tmp_path, monkeypatch):
    _killed(streets, tmp_path, monkeypatch)
    before = (tmp_path / "checkpoint.safetensors").read_bytes()
    for architecture, params, differing in (
        (SMALL, replace(QUICK, learning_rate=0.1), r"\{'learning_rate': 0.05\}, found \{'learning_rate': 0.1\}"),
        (replace(SMALL, segmenter="fcn"), QUICK, r"\{'segmenter': 'segnet'\}, found \{'segmenter': 'fcn'\}"),
        (replace(SMALL, heights=(0.0, 0.5)), QUICK, r"\{'heights': \[0.0, 0.5, 1.0\]\}, found"),
    ):
        with pytest.raises(ArgumentError, match=f"resume: expected the run of .*checkpoint.safetensors, {differing}"):
            train(build_net(architecture, CAMERA), streets, tmp_path, params, resume=True)
    others = [sample._replace(truth=torch.zeros_like(sample.truth)) for sample in streets]
    with pytest.raises(ArgumentError, match=r"checkpoint.safetensors, \{'grid class weights': .*found \{'grid class w"):
        train(build_net(SMALL, CAMERA), others, tmp_path, QUICK, resume=True)
    assert (tmp_path / "checkpoint.safetensors").read_bytes() == before


def test_resume_begins_where_nothing_was_kept(streets, tmp_path):
    for folder, resume in (("begun", False), ("resumed", True)):
        train(build_net(SMALL, CAMERA, seed=9), streets, tmp_path / folder, QUICK, resume=resume)
    begun, resumed = ((tmp_path / folder / "weights.safetensors").read_bytes() for folder in ("begun", "resumed"))
    assert begun == resumed


def test_no_training_is_overwritten(streets, tmp_path, monkeypatch):
    _killed(streets, tmp_path, monkeypatch)
    with pytest.raises(DataError, match=r"--resume continues it\), found checkpoint.safetensors"):
        train(build_net(SMALL, CAMERA), streets, tmp_path, QUICK)
    train(build_net(SMALL, CAMERA), streets, tmp_path, QUICK, resume=True)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    for resume in (False, True):
        with pytest.raises(DataError, match=r"a trained network, which would be lost, found weights.safetensors"):
            train(build_net(SMALL, CAMERA), streets, tmp_path, QUICK, resume=resume)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_full_disk_keeps_the_checkpoint_before(streets, tmp_path, monkeypatch):
    """A limit to the size of files does what a full disk does: the system refuses to write on."""
    monkeypatch.setattr(training, "CHECKPOINT_EVERY", 2)
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    path, hard = broken / "checkpoint.safetensors", resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    train(build_net(SMALL, CAMERA), streets, whole, QUICK)

    def fill(reads):
        if reads == 0:  # in the third step, after the first checkpoint
            kept.append(path.read_bytes())
            resource.setrlimit(resource.RLIMIT_FSIZE, (len(kept[0]), hard))

    kept = []
    watched = Watched(streets, 3 * len(streets) + 2 * QUICK.batch_size, fill)
    try:
        with pytest.raises(OSError, match="File too large") as caught:
            train(build_net(SMALL, CAMERA), watched, broken, QUICK)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    assert caught.value.filename == str(path)
    assert path.read_bytes() == kept[0]
    assert {p.name for p in broken.iterdir()} == {path.name, "image_stage.safetensors", "log.csv"}
    train(build_net(SMALL, CAMERA), streets, broken, QUICK, resume=True)
    _same_files(whole, broken)


def test_a_checkpoint_that_lacks_a_tensor_is_refused(streets, tmp_path, monkeypatch):
    _killed(streets, tmp_path, monkeypatch)
    path = tmp_path / "checkpoint.safetensors"
    header, tensors = read_tensors(path)
    del tensors["net.fusion.reduce.0.bias"]
    write_tensors(path, tensors, header)
    with pytest.raises(DataError, match=r"checkpoint.safetensors: expected \(16,\) for fusion.reduce.0.bias, found no"):
        train(build_net(SMALL, CAMERA), streets, tmp_path, QUICK, resume=True)
