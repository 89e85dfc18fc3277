import resource
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import pytest
import torch
import torch.nn.functional as F
from safetensors.torch import load_file, save_file
from sklearn.metrics import accuracy_score
from tiny_streets import CAMERA, SMALL, tiny_streets

from semgrid_edu import checkpoint, training
from semgrid_edu.batches import Batch, draw_batch, grid_logits, image_scores
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.loss import median_frequency_weights
from semgrid_edu.networks import SEGMENTERS, build_net
from semgrid_edu.training import TrainingParams, train
from semgrid_edu.training_log import read_log

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
def camera():
    return CAMERA


@pytest.fixture(scope="module")
def streets():
    return tiny_streets()


# Batches


def test_each_pass_takes_every_frame_once(streets):
    for epoch in range(3):
        batches = [draw_batch(streets, 2, 0.0, 2 * epoch + k, seed=0).frames.truth for k in range(2)]
        drawn = sorted(truth.numpy().tobytes() for truth in torch.cat(batches))
        assert drawn == sorted(sample.truth.numpy().tobytes() for sample in streets)


def test_a_batch_is_a_function_of_seed_and_step(streets):
    def image(iteration, seed):
        return draw_batch(streets, 2, 0.2, iteration, seed).frames.image

    assert torch.equal(image(5, 1), image(5, 1))
    assert not torch.equal(image(5, 1), image(6, 1))
    assert not torch.equal(image(5, 1), image(5, 2))
    assert image(5, 1).min() >= 0
    assert image(5, 1).max() <= 1


def test_a_mirror_changes_what_the_network_sees_and_not_where_it_lies(camera, streets):
    """Networks that answer each place by itself can't tell a mirror from the street."""
    frames = draw_batch(streets, 2, 0.0, 0, seed=0).frames
    seen = []
    by_place = SimpleNamespace(
        segmenter=lambda image: seen.append(image) or image * 2,
        sampler=build_net(SMALL, camera).sampler,
        fusion=SimpleNamespace(
            reduce=lambda planes: planes.sum(dim=2, keepdim=True),
            fuse=lambda reduced, occupancy: reduced.squeeze(2) + occupancy[:, :1],
        ),
    )
    plain, mirrored = (grid_logits(by_place, Batch(frames, m)) for m in (False, True))
    torch.testing.assert_close(plain, mirrored)
    assert torch.equal(seen[0], seen[1].flip(-1))
    assert not torch.equal(seen[0], seen[1])


# The loop


def test_the_learning_rate_falls_to_zero_in_each_stage():
    params = TrainingParams(image_iterations=10, grid_iterations=20, learning_rate=0.1)
    steps = [params.stage(k) for k in range(params.iterations)]
    assert [stage for stage, _ in steps] == ["image"] * 10 + ["grid"] * 20
    assert steps[0][1] == steps[10][1] == pytest.approx(0.1)
    assert steps[20][1] == pytest.approx(0.05)
    for (stage, rate), (next_stage, next_rate) in pairwise(steps):
        assert next_rate < rate or next_stage != stage


def test_four_streets_are_learnt_by_heart(camera, streets, tmp_path):
    params = TrainingParams(image_iterations=30, grid_iterations=60, batch_size=4, learning_rate=0.1, jitter=0.0)
    net = build_net(SMALL, camera)
    train(net, streets, tmp_path, params)
    image, occupancy, truth = (
        torch.stack(x) for x in zip(*((s.image, s.occupancy, s.truth) for s in streets), strict=True)
    )
    assert accuracy_score(truth.ravel(), net(image / 255, occupancy).argmax(1).ravel()) >= 0.99


@pytest.mark.parametrize("end_to_end", [True, False])
def test_two_stages_leave_the_image_network_as_it_was(camera, streets, tmp_path, end_to_end):
    train(build_net(SMALL, camera), streets, tmp_path, replace(QUICK, end_to_end=end_to_end))
    before, after = (load_file(tmp_path / name) for name in ("image_stage.safetensors", "weights.safetensors"))
    kept = {name: torch.equal(before[name], after[name]) for name in before}
    assert all(kept[name] is not end_to_end for name in kept if name.startswith("segmenter"))
    assert not any(kept[name] for name in kept if name.startswith("fusion") and name.endswith("weight"))


def test_what_learnt_before_learns_after(camera, streets, tmp_path):
    """Two-stage training stops the image network for a while; what the caller stopped stays so."""
    net = build_net(SMALL, camera)
    stopped = net.fusion.reduce[0].weight.requires_grad_(False)
    before = stopped.clone()
    train(net, streets, tmp_path, replace(QUICK, end_to_end=False))
    assert [parameter for parameter in net.parameters() if not parameter.requires_grad] == [stopped]
    assert torch.equal(stopped, before)
    assert not any(module.training for module in net.modules())


@pytest.mark.parametrize("segmenter", SEGMENTERS)
def test_mixed_precision_learns_too(camera, streets, tmp_path, monkeypatch, segmenter):
    """What a GPU does, on the CPU: convolutions in bfloat16, weights and loss in float32."""
    monkeypatch.setattr(training, "mixed_precision", lambda device: torch.autocast(device.type, torch.bfloat16))
    net, types = build_net(replace(SMALL, segmenter=segmenter), camera), set()
    net.sampler.register_forward_hook(lambda _, scores, planes: types.update((scores[0].dtype, planes.dtype)))
    train(net, streets, tmp_path, TrainingParams(10, 15, batch_size=4, learning_rate=0.1))
    log = read_log(tmp_path / "log.csv")
    for stage in ("image", "grid"):
        loss = log.loss[log.stage == stage]
        assert loss[-1] < 0.6 * loss[0]
    # DeepLab ends with an interpolation, which is float32 on a CPU.
    assert types == {torch.float32 if segmenter == "deeplab" else torch.bfloat16}
    assert {parameter.dtype for parameter in net.parameters()} == {torch.float32}


def test_the_first_losses_are_those_of_the_definition(camera, streets, tmp_path):
    """Weighted cross-entropy over labelled pixels, written out."""
    net = build_net(SMALL, camera)
    batch = draw_batch(streets, QUICK.batch_size, QUICK.jitter, 0, seed=0)
    net.train()
    log_p = F.log_softmax(image_scores(net, batch), dim=1)
    alpha = median_frequency_weights([s.labels.numpy() for s in streets], 14, QUICK.weight_limit)
    labels = batch.frames.labels
    weight = torch.from_numpy(alpha)[labels.long()]
    chosen = log_p.gather(1, labels.long()[:, None])[:, 0]
    expected = -(weight * chosen).sum() / weight.sum()
    train(build_net(SMALL, camera), streets, tmp_path, QUICK)
    first = read_log(tmp_path / "log.csv").loss[0]
    assert first == pytest.approx(expected.item(), rel=1e-4)


class _KilledError(Exception):
    pass


class _Watched:
    """Streets, and what happens as they are read: `event` gets how many reads are left."""

    def __init__(self, streets, reads, event):
        self.streets, self.reads, self.event = streets, reads, event

    def __len__(self):
        return len(self.streets)

    def __getitem__(self, k):
        if k >= len(self.streets):
            raise IndexError(k)
        self.event(self.reads)
        self.reads -= 1
        return self.streets[k]


def _kill(reads):
    """The power fails."""
    if reads == 0:
        raise _KilledError


def _same_files(first, second):
    assert {path.name for path in first.iterdir()} == {path.name for path in second.iterdir()} == ENDED
    for name in ENDED:
        assert (first / name).read_bytes() == (second / name).read_bytes(), name


@pytest.mark.parametrize("steps_before_the_kill", [2, 5])
def test_a_resumed_run_ends_with_the_same_bytes(camera, streets, tmp_path, monkeypatch, steps_before_the_kill):
    monkeypatch.setattr(training, "CHECKPOINT_EVERY", 2)
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    train(build_net(SMALL, camera, seed=1), streets, whole, QUICK, seed=1)
    reads = 3 * len(streets) + QUICK.batch_size * steps_before_the_kill  # check, weights of two stages, steps
    with pytest.raises(_KilledError):
        train(build_net(SMALL, camera, seed=1), _Watched(streets, reads, _kill), broken, QUICK, seed=1)
    assert (broken / "checkpoint.safetensors").exists()
    train(build_net(SMALL, camera, seed=9), streets, broken, QUICK, seed=1, resume=True)
    _same_files(whole, broken)


def test_another_seed_gives_other_weights(camera, streets, tmp_path):
    for seed in (1, 2):
        train(build_net(SMALL, camera), streets, tmp_path / str(seed), QUICK, seed=seed)
    first, second = ((tmp_path / str(seed) / "weights.safetensors").read_bytes() for seed in (1, 2))
    assert first != second


# What can go wrong


def test_a_loss_that_is_not_finite_stops_the_run(camera, streets, tmp_path):
    wild = TrainingParams(image_iterations=50, grid_iterations=1, batch_size=2, learning_rate=1e30)
    with pytest.raises(ArgumentError, match="learning_rate: expected a rate that keeps the loss finite"):
        train(build_net(SMALL, camera), streets, tmp_path, wild)
    assert not (tmp_path / "weights.safetensors").exists()


def test_frames_that_do_not_fit_are_refused(camera, streets, tmp_path):
    net = build_net(SMALL, camera)
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
def test_wrong_labels_are_refused(camera, streets, tmp_path, field):
    wrong = [*streets[:2], streets[2]._replace(**{field: torch.full_like(getattr(streets[2], field), 77)})]
    message = f"{field} of the dataset: expected classes 0..13 or 255, found 77..77 in map 2"
    with pytest.raises(ArgumentError, match=message):
        train(build_net(SMALL, camera), wrong, tmp_path, QUICK)
    assert not list(tmp_path.iterdir())


def test_a_network_that_could_not_be_saved_is_not_trained(camera, streets, tmp_path):
    net = build_net(SMALL, camera)
    del net.architecture
    with pytest.raises(ArgumentError, match="net: expected a network of build_net"):
        train(net, streets, tmp_path, QUICK)


def _checkpoint(camera, path, run=None):
    net = build_net(SMALL, camera)
    checkpoint.save_checkpoint(path, run or {}, net, torch.optim.SGD(net.parameters(), lr=0.1, momentum=0.9), 2)


def _killed(camera, streets, folder, monkeypatch, architecture=SMALL):
    """A training that was killed in its fourth step and has kept a checkpoint after two."""
    monkeypatch.setattr(training, "CHECKPOINT_EVERY", 2)
    reads = 3 * len(streets) + 3 * QUICK.batch_size
    with pytest.raises(_KilledError):
        train(build_net(architecture, camera), _Watched(streets, reads, _kill), folder, QUICK)


def test_only_its_own_run_is_resumed(camera, streets, tmp_path, monkeypatch):
    _killed(camera, streets, tmp_path, monkeypatch)
    before = (tmp_path / "checkpoint.safetensors").read_bytes()
    for architecture, params, differing in (
        (SMALL, replace(QUICK, learning_rate=0.1), r"\{'learning_rate': 0.05\}, found \{'learning_rate': 0.1\}"),
        (replace(SMALL, segmenter="fcn"), QUICK, r"\{'segmenter': 'segnet'\}, found \{'segmenter': 'fcn'\}"),
        (replace(SMALL, heights=(0.0, 0.5)), QUICK, r"\{'heights': \[0.0, 0.5, 1.0\]\}, found"),
    ):
        with pytest.raises(ArgumentError, match=f"resume: expected the run of .*checkpoint.safetensors, {differing}"):
            train(build_net(architecture, camera), streets, tmp_path, params, resume=True)
    assert (tmp_path / "checkpoint.safetensors").read_bytes() == before


def test_no_training_is_overwritten(camera, streets, tmp_path, monkeypatch):
    _killed(camera, streets, tmp_path, monkeypatch)
    with pytest.raises(DataError, match=r"--resume continues it\), found checkpoint.safetensors"):
        train(build_net(SMALL, camera), streets, tmp_path, QUICK)
    train(build_net(SMALL, camera), streets, tmp_path, QUICK, resume=True)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    for resume in (False, True):
        with pytest.raises(DataError, match=r"a trained network, which would be lost, found weights.safetensors"):
            train(build_net(SMALL, camera), streets, tmp_path, QUICK, resume=resume)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_full_disk_keeps_the_checkpoint_before(camera, streets, tmp_path, monkeypatch):
    """A limit to the size of files does what a full disk does: the system refuses to write on."""
    monkeypatch.setattr(training, "CHECKPOINT_EVERY", 2)
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    path, hard = broken / "checkpoint.safetensors", resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    train(build_net(SMALL, camera), streets, whole, QUICK)

    def fill(reads):
        if reads == 0:  # in the third step, after the first checkpoint
            kept.append(path.read_bytes())
            resource.setrlimit(resource.RLIMIT_FSIZE, (len(kept[0]), hard))

    kept = []
    watched = _Watched(streets, 3 * len(streets) + 2 * QUICK.batch_size, fill)
    try:
        with pytest.raises(OSError, match="File too large") as caught:
            train(build_net(SMALL, camera), watched, broken, QUICK)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    assert caught.value.filename == str(path)
    assert path.read_bytes() == kept[0]
    assert {p.name for p in broken.iterdir()} == {path.name, "image_stage.safetensors", "log.csv"}
    train(build_net(SMALL, camera), streets, broken, QUICK, resume=True)
    _same_files(whole, broken)


def test_a_missing_or_damaged_checkpoint_is_named(camera, streets, tmp_path):
    path = tmp_path / "checkpoint.safetensors"
    with pytest.raises(DataError, match=r"checkpoint.safetensors: expected a safetensors file, found no such file"):
        train(build_net(SMALL, camera), streets, tmp_path, QUICK, resume=True)
    _checkpoint(camera, path)
    whole = path.read_bytes()
    for content in (whole[:100], whole[: len(whole) // 2], b""):
        path.write_bytes(content)
        with pytest.raises(DataError, match=r"checkpoint.safetensors: expected a safetensors file"):
            train(build_net(SMALL, camera), streets, tmp_path, QUICK, resume=True)
    path.write_bytes(whole)
    save_file(load_file(path), path)
    with pytest.raises(DataError, match="expected a checkpoint of a training"):
        train(build_net(SMALL, camera), streets, tmp_path, QUICK, resume=True)
