"""The story of a cell: its numbers are the pipeline's own, and they add up."""

import dataclasses

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import softmax
from tiny_drive import DATE, write_tiny_drive
from torch import nn

from semgrid_edu import plotting
from semgrid_edu.crf import (
    CrfParams,
    damping,
    gram_matrix,
    mean_field_naive,
    pair_weights,
    unary_from_probability,
)
from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast import track_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks import Architecture, build_net
from semgrid_edu.occupancy import CmcdotParams, SensorModel, scan_evidence, update
from semgrid_edu.occupancy.state import FilterState, Particles
from semgrid_edu.pipeline import Stages, run_pipeline
from semgrid_edu.planes import plane_pixels
from semgrid_edu.story import (
    NeighbourPull,
    cell_contributions,
    cell_scan,
    cell_story,
    contribution_maps,
    neighbour_messages,
    neighbour_pull,
    place_history,
    strongest_neighbours,
    weights_of_cell,
)
from semgrid_edu.story.cell_story import label_and_rival

SPEC = GridSpec.compact()
CELLS = [(81, 31), (82, 25), (120, 33), (30, 5), (0, 0), (141, 61)]
"""On the wall of the tiny drive, before it, on the road, far away, and two corners."""
SMALL_GRID = GridSpec(0, 16, -8, 8, 0.5)


def random_net(camera, **changes):
    """A network whose batch normalisations do something, in evaluation mode."""
    net = build_net(Architecture(**changes), camera, seed=3).eval()
    generator = torch.Generator().manual_seed(5)
    for module in net.fusion.modules():
        if isinstance(module, nn.BatchNorm2d | nn.BatchNorm3d):
            module.running_mean.normal_(generator=generator)
            module.running_var.uniform_(0.5, 2, generator=generator)
            module.bias.data.normal_(generator=generator)
    return net


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    root = tmp_path_factory.mktemp("drive")
    write_tiny_drive(root)
    return KittiRawDrive(root, DATE, "0001")


@pytest.fixture(scope="module")
def net(drive):
    return random_net(drive.camera)


@pytest.fixture(scope="module")
def results(drive, net):
    return list(run_pipeline(drive, Stages.of(net, keep_steps=True)))


@pytest.fixture(scope="module")
def maps(results, net):
    return contribution_maps(net, results[-1].scores, results[-1].belief.probability)


@pytest.fixture(scope="module", params=CELLS, ids=str)
def story(request, results, net):
    return cell_story(results[-1], request.param, net, past=results[:-1])


PARAMS = CmcdotParams(n_particles=5000)


@pytest.fixture(scope="module")
def both(drive):
    """The beliefs of two filters; only the second keeps its steps."""
    return [list(track_drive(drive, SPEC, PARAMS, keep_steps=keep)) for keep in (False, True)]


class TestFilter:
    def test_to_keep_the_steps_changes_no_bit(self, both):
        for plain, kept in zip(*both, strict=True):
            for name in ("probability", "velocity", "velocity_covariance"):
                np.testing.assert_array_equal(getattr(plain, name), getattr(kept, name))
            assert plain.steps == {}

    def test_the_four_states_sum_to_one_after_each_step(self, both):
        for belief in both[1]:
            assert list(belief.steps) == ["move", "predict", "update", "resample"]
            for states in belief.steps.values():
                assert states.shape == (4, *SPEC.shape)
                np.testing.assert_allclose(states.sum(axis=0), 1, atol=1e-5)

    def test_what_is_shown_is_the_prediction_updated_with_the_scan_in_these_cells(self, drive, both):
        for frame, belief in zip(drive, both[1], strict=True):
            evidence = scan_evidence(frame.points_grid, SPEC, SensorModel())
            predicted = FilterState(belief.steps["predict"], Particles.none(), np.zeros(SPEC.shape))
            updated = update(predicted, SPEC, evidence, PARAMS)
            np.testing.assert_allclose(belief.probability, updated.probability, atol=1e-5)

    def test_nothing_is_known_when_the_first_frame_begins(self, both):
        np.testing.assert_array_equal(both[1][0].steps["move"][3], 1)


class TestScan:
    @settings(max_examples=15, deadline=None)
    @given(st.integers(0, 2**31))
    def test_is_that_of_the_whole_grid(self, seed):
        rng = np.random.default_rng(seed)
        points = np.stack([rng.uniform(-2, 18, 400), rng.uniform(-9, 9, 400), rng.uniform(-0.2, 3, 400)], axis=-1)
        sensor = SensorModel(ground=None)
        evidence = scan_evidence(points.astype(np.float32), SMALL_GRID, sensor)
        for cell in rng.integers(0, 32, (40, 2)).tolist():
            said = cell_scan(points.astype(np.float32), SMALL_GRID, tuple(cell), sensor)
            assert said.occupied == evidence.occupied[*cell]
            assert said.free == evidence.free[*cell]
            assert {"hit": said.occupied > said.free, "silent": said.occupied == said.free}.get(
                said.verdict, said.free > said.occupied
            )

    def test_a_wall_by_hand(self):
        wall = np.array([[8.25, y, 1.0] for y in np.arange(-1.99, 2, 0.02)])
        ground = np.array([[x, 3.25, 0.0] for x in np.arange(3, 15.5, 0.1)])
        points = np.concatenate([wall, ground]).astype(np.float32)
        said = {
            name: cell_scan(points, SMALL_GRID, SMALL_GRID_CELLS[name], SensorModel(ground=None))
            for name in SMALL_GRID_CELLS
        }
        assert {name: one.verdict for name, one in said.items()} == {
            "wall": "hit", "before": "passed", "behind": "silent", "ground": "ground", "nothing": "silent",
        }  # fmt: skip
        assert len(said["wall"].obstacles) == 25
        assert said["before"].reach == pytest.approx(np.hypot(8.25, 0.2), abs=0.05)
        assert said["behind"].distance > said["behind"].reach > 8
        assert said["nothing"].reach == 0


SMALL_GRID_CELLS = {"wall": (15, 15), "before": (20, 15), "behind": (8, 15), "ground": (1, 9), "nothing": (31, 31)}
"""Cells around (8.25, 0.25), (5.75, 0.25), (11.75, 0.25), (15.25, 3.25), (0.25, -7.75)."""


class TestContributions:
    def test_sum_to_the_logit(self, story, results, net):
        logits = self.logits(net, results[-1])
        for label, parts in ((story.label, story.for_label), (story.rival, story.for_rival)):
            assert parts.score == pytest.approx(logits[label, *story.cell], abs=1e-4)
            assert parts.planes.sum() + parts.occupancy.sum() + parts.rest == pytest.approx(parts.score, abs=1e-9)

    def test_the_difference_is_the_logarithm_of_the_ratio_of_probabilities(self, story, results):
        why = story.for_label.minus(story.for_rival)
        label, rival = results[-1].grid[[story.label, story.rival], *story.cell]
        assert why.score == pytest.approx(np.log(label / rival), abs=1e-3)
        assert why.planes.sum() + why.occupancy.sum() + why.rest == pytest.approx(why.score, abs=1e-9)

    def test_what_remains_is_the_part_of_the_biases_and_of_the_shifts_of_the_normalisations(self, story, results, net):
        scores = torch.tensor(results[-1].scores)[None]
        o = torch.tensor(results[-1].belief.probability)[None]
        logit = net.fusion(net.sampler(scores), o)[0, story.label, *story.cell]
        constants = []
        for module in net.fusion.modules():
            if isinstance(module, nn.BatchNorm2d | nn.BatchNorm3d):
                scale = module.weight / (module.running_var + module.eps).sqrt()
                constants.append((module.bias, module.bias - scale * module.running_mean))
            elif getattr(module, "bias", None) is not None:
                constants.append((module.bias, module.bias))
        gradients = torch.autograd.grad(logit, [bias for bias, _ in constants])
        part = sum((g * constant).sum().item() for g, (_, constant) in zip(gradients, constants, strict=True))
        assert story.for_label.rest == pytest.approx(part, rel=1e-3, abs=1e-3)

    def test_maps_hold_those_of_every_cell(self, story, maps, results, net):
        at = (slice(None), story.label, *story.cell)
        parts = story.for_label
        np.testing.assert_allclose(maps.by_plane[at], parts.planes.sum(axis=0), atol=1e-4)
        np.testing.assert_allclose(maps.by_class[at], parts.planes.sum(axis=1), atol=1e-4)
        np.testing.assert_allclose(maps.occupancy[at], parts.occupancy, atol=1e-4)
        np.testing.assert_allclose(maps.rest[at[1:]], parts.rest, atol=1e-3)
        np.testing.assert_allclose(maps.score, self.logits(net, results[-1]), atol=1e-4)

    @pytest.mark.parametrize("changes", [{"uses_occupancy": False}, {"reduces": False}])
    def test_of_other_architectures(self, drive, results, changes):
        net = random_net(drive.camera, grid=SMALL_GRID, **changes)
        given_o = np.ascontiguousarray(results[-1].belief.probability[:, -32:, 15:47])
        parts = cell_contributions(net, results[-1].scores, given_o, (12, 16), 3)
        maps = contribution_maps(net, results[-1].scores, given_o)
        np.testing.assert_allclose(maps.by_plane[:, 3, 12, 16], parts.planes.sum(axis=0), atol=1e-4)
        np.testing.assert_allclose(maps.occupancy[:, 3, 12, 16], parts.occupancy, atol=1e-4)
        assert parts.occupancy.any() == net.fusion.uses_occupancy

    def test_a_network_in_training_mode_is_refused(self, drive, results):
        net = build_net(Architecture(), drive.camera)
        with pytest.raises(ArgumentError, match="evaluation mode"):
            contribution_maps(net, results[0].scores, results[0].belief.probability)

    @staticmethod
    @torch.no_grad()
    def logits(net, result):
        p, o = net.sampler(torch.tensor(result.scores)[None]), torch.tensor(result.belief.probability)[None]
        return net.fusion(p, o)[0].numpy()


class TestPull:
    RNG = np.random.default_rng(2)
    STATES = RNG.dirichlet(np.full(4, 0.4), (14, 11)).transpose(2, 0, 1)
    G = RNG.dirichlet(np.ones(5), (14, 11)).transpose(2, 0, 1)

    @pytest.mark.parametrize("normalization", ["symmetric", "none"])
    @pytest.mark.parametrize("cell", [(0, 0), (7, 5), (13, 10)])
    def test_weights_are_a_row_of_those_of_all_pairs(self, normalization, cell):
        params = CrfParams(sigma_alpha=3.2, sigma_gamma=1.2, normalization=normalization)
        row = pair_weights(self.STATES, params)[cell[0] * 11 + cell[1]].reshape(14, 11)
        np.testing.assert_allclose(weights_of_cell(self.STATES, params, cell), row, rtol=2e-3, atol=1e-5)

    def test_the_update_is_that_of_the_naive_mean_field(self):
        params = CrfParams(sigma_alpha=3.2, sigma_gamma=1.2)
        refined = mean_field_naive(unary_from_probability(self.G), self.STATES, params, iterations=1)
        pull = neighbour_pull(self.G, refined, self.STATES, (7, 5), params, iterations=1)
        np.testing.assert_allclose(pull.neighbours, self.G, atol=1e-5)
        np.testing.assert_array_equal(pull.after, refined[:, 7, 5])
        part = damping(gram_matrix(self.STATES, params)[7 * 11 + 5, 7 * 11 + 5])
        updated = softmax(np.log(self.G[:, 7, 5]) + part * pull.messages)  # from the unary term itself: nothing to undo
        np.testing.assert_allclose(updated, pull.after, atol=1e-3)

    @pytest.mark.parametrize("normalization", ["symmetric", "none"])
    def test_of_every_cell_at_once(self, normalization):
        params = CrfParams(sigma_alpha=3.2, sigma_gamma=1.2, normalization=normalization)
        labels = self.G.argmax(axis=0)
        messages = neighbour_messages(self.G.astype(np.float32), self.STATES, params)
        steps, pulls = strongest_neighbours(self.G.astype(np.float32), labels, self.STATES, params)
        for cell in [(0, 0), (7, 5), (13, 10), (3, 9)]:
            pull = NeighbourPull(self.G, self.G, weights_of_cell(self.STATES, params, cell), self.G)
            np.testing.assert_allclose(messages[:, *cell], pull.messages, rtol=1e-4)
            cells, expected = pull.strongest(labels[cell])
            np.testing.assert_array_equal(steps[:, :, *cell].T + cell, cells)
            np.testing.assert_allclose(pulls[:, *cell], expected, rtol=1e-3)

    def test_the_strongest_neighbours_are_terms_of_the_message(self, story):
        terms = story.pull.weights * story.pull.neighbours[story.refined]
        cells, pull = story.pull.strongest(story.refined)
        np.testing.assert_allclose(pull, terms[tuple(cells.T)])
        assert pull[0] == terms.max()
        every, all_of_them = story.pull.strongest(story.refined, terms.size)
        assert len(np.unique(every, axis=0)) == terms.size
        assert all_of_them.sum() == pytest.approx(story.pull.messages[story.refined])

    def test_the_neighbours_explain_the_fast_crf_too(self, story, results):
        """Of the last update of a cell: all but how far it goes, which is nearly all the way."""
        updated = softmax(np.log(story.pull.before) + story.pull.messages)
        np.testing.assert_allclose(updated, story.pull.after, atol=0.1)

    def test_no_update_is_refused(self):
        with pytest.raises(ArgumentError, match="at least one update"):
            neighbour_pull(self.G, self.G, self.STATES, (0, 0), CrfParams(), iterations=0)


class TestStory:
    def test_holds_the_pipelines_own_results(self, story, results, drive):
        result = results[-1]
        assert story.label == result.grid[:, *story.cell].argmax()
        assert story.refined == result.refined[:, *story.cell].argmax()
        np.testing.assert_array_equal(story.pull.after.astype(np.float32), result.refined[:, *story.cell])
        for name, states in {**result.belief.steps, "shown": result.belief.probability}.items():
            np.testing.assert_array_equal(story.steps[name], states[:, *story.cell])
            assert story.steps[name].sum() == pytest.approx(1, abs=1e-5)
        truth = grid_truth(result.frame.labels, result.belief.probability, SPEC)
        assert story.truth == truth[story.cell]
        pixels, visible = plane_pixels(SPEC, story.heights, drive.camera)
        np.testing.assert_array_equal(story.pixels, pixels[:, *story.cell])
        np.testing.assert_array_equal(story.visible, visible[:, *story.cell])

    def test_history_ends_with_now_and_sums_to_one(self, story):
        assert story.history.shape == (4, 3)
        np.testing.assert_array_equal(story.history[:, -1], story.steps["shown"])
        np.testing.assert_allclose(story.history.sum(axis=0), 1, atol=1e-5)
        np.testing.assert_allclose(np.diff(story.times), 0.1, atol=1e-6)

    def test_the_vehicle_drives_a_metre_a_frame_so_the_place_was_two_rows_further_ahead(self, results):
        _, history = place_history(results, SPEC, (90, 30))
        for k, result in enumerate(results):
            row = 90 - 2 * (len(results) - 1 - k)
            np.testing.assert_array_equal(history[:, k], result.belief.probability[:, row, 30])

    def test_a_place_outside_the_grid_was_unknown(self, results):
        _, history = place_history(results, SPEC, (1, 30))
        np.testing.assert_array_equal(history[:, 0], [0, 0, 0, 1])

    @pytest.mark.parametrize(
        ("truth", "expected"), [(2, (2, 0)), (1, (2, 1)), (255, (2, 0))]
    )  # fmt: skip
    def test_a_class_is_compared_with_the_truth_or_the_second_best(self, truth, expected):
        assert label_and_rival(np.array([0.3, 0.1, 0.6]), truth) == expected

    def test_another_network_is_refused(self, results, drive):
        other = build_net(Architecture(), drive.camera, seed=9).eval()
        with pytest.raises(ArgumentError, match="network that made the result"):
            cell_story(results[-1], (100, 30), other)
        for cell in np.random.default_rng(0).integers((0, 0), other.architecture.grid.shape, (20, 2)):
            with pytest.raises(ArgumentError, match="network that made the result"):
                cell_story(results[-1], tuple(cell), other)

    @pytest.mark.parametrize("cell", [(-1, 0), (142, 0), (0, 62), (1.5, 2.5), (3.0, 4), (1,), (1, 2, 3), 5, None, "ab"])
    def test_a_cell_outside_the_grid_is_refused(self, results, net, cell):
        with pytest.raises(ArgumentError, match="row and column"):
            cell_story(results[-1], cell, net)

    def test_is_told_without_steps_too(self, results, net):
        belief = dataclasses.replace(results[-1].belief, steps={})
        assert list(cell_story(dataclasses.replace(results[-1], belief=belief), (90, 30), net).steps) == ["shown"]


class TestFigure:
    @pytest.fixture
    def axes(self, results, net):
        story = cell_story(results[-1], (82, 25), net, past=results[:-1])
        figure = plotting.draw_cell_story(story, results[-1].frame.image)
        yield story, figure.axes
        plt.close(figure)

    def test_bars_are_the_parts_and_the_last_is_their_sum(self, axes):
        story, (_, _, kinds, planes, *_) = axes
        image, occupancy, constants, total = (bar.get_width() for bar in kinds.patches)
        assert image + occupancy + constants == pytest.approx(total)
        assert sum(bar.get_width() for bar in planes.patches) == pytest.approx(image)
        assert total == pytest.approx(story.for_label.score - story.for_rival.score)

    def test_states_fill_their_bars(self, axes):
        story, (_, steps, *_) = axes
        ends = [bar.get_x() + bar.get_width() for bar in steps.patches[-len(story.steps) :]]
        np.testing.assert_allclose(ends, 1, atol=1e-5)

    def test_points_of_the_planes_lie_where_eq_1_says(self, axes):
        story, (image, *_) = axes
        np.testing.assert_allclose(image.collections[0].get_offsets(), story.pixels[story.visible])

    def test_without_an_image(self, axes):
        story, with_image = axes
        figure = plotting.draw_cell_story(story)
        assert len(figure.axes) == len(with_image) - 1
        plt.close(figure)
