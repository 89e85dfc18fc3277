"""The story of a cell: its numbers are the pipeline's own, and they add up."""

import dataclasses

import numpy as np
import pytest
import torch
from scipy.special import softmax
from tiny_drive import STEP

from semgrid_edu.crf import CrfParams, pair_weights
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast import track_drive, with_fast_sampler
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import Architecture, build_net
from semgrid_edu.occupancy import CmcdotParams, SensorModel, State, scan_evidence, update
from semgrid_edu.occupancy.state import FilterState, Particles
from semgrid_edu.pipeline import Stages, run_pipeline
from semgrid_edu.planes import cell_heights, plane_pixels
from semgrid_edu.workshop.demo import cell_story
from semgrid_edu.workshop.demo.contributions import contributions, fusion_inputs
from semgrid_edu.workshop.demo.evidence import VERDICTS, place_history, scan_maps
from semgrid_edu.workshop.demo.neighbours import neighbour_pull
from semgrid_edu.workshop.demo.stories import frame_story
from semgrid_edu.workshop.demo.what_if import FAULTS

PARAMS = CmcdotParams(n_particles=5000)
SPEC = GridSpec.compact()
SMALL_GRID = GridSpec(0, 16, -8, 8, 0.5)


def by_gradient(net, scores, o, cell, label) -> tuple[np.ndarray, np.ndarray]:
    """Gradient times input of one logit, by a backward pass: (C, D) for the planes and (4,) for the occupancy."""
    planes = net.sampler(torch.tensor(scores)[None]).detach().requires_grad_()
    states = torch.tensor(o)[None].requires_grad_()
    logit = net.fusion(planes, states)[0, label, *cell]
    gradients = torch.autograd.grad(logit, (planes, states), materialize_grads=True)
    of_planes, of_states = ((g * x)[0].sum(dim=(-2, -1)) for g, x in zip(gradients, (planes, states), strict=True))
    return of_planes.detach().numpy(), of_states.detach().numpy()


def test_keeping_the_steps_changes_no_bit_and_each_sums_to_one(last_labelled):
    both = [list(track_drive(last_labelled, SPEC, PARAMS, keep_steps=keep)) for keep in (False, True)]
    for plain, kept in zip(*both, strict=True):
        for name in ("probability", "velocity", "velocity_covariance"):
            np.testing.assert_array_equal(getattr(plain, name), getattr(kept, name))
        assert plain.steps == {}
        assert list(kept.steps) == ["move", "predict", "update", "resample"]
        for states in kept.steps.values():
            assert states.shape == (4, *SPEC.shape)
            np.testing.assert_allclose(states.sum(axis=0), 1, atol=1e-5)
    np.testing.assert_array_equal(both[1][0].steps["move"][3], 1)  # nothing is known when the first frame begins


def test_what_is_shown_is_the_prediction_updated_with_the_scan_in_these_cells(last_labelled):
    beliefs = track_drive(last_labelled, SPEC, PARAMS, keep_steps=True)
    for frame, belief in zip(last_labelled, beliefs, strict=True):
        evidence = scan_evidence(frame.points_grid, SPEC, SensorModel())
        predicted = FilterState(belief.steps["predict"], Particles.none(), np.zeros(SPEC.shape))
        updated = update(predicted, SPEC, evidence, PARAMS)
        np.testing.assert_allclose(belief.probability, updated.probability, atol=1e-5)


def test_a_wall_by_hand():
    wall = np.array([[8.25, y, 1.0] for y in np.arange(-1.99, 2, 0.02)])
    ground = np.array([[x, 3.25, 0.0] for x in np.arange(3, 15.5, 0.1)])
    points = np.concatenate([wall, ground]).astype(np.float32)
    maps = scan_maps(points, SMALL_GRID, SensorModel(ground=None))
    places = {"wall": (8.25, 0.25), "before": (5.75, 0.25), "behind": (11.75, 0.25), "ground": (15.25, 3.25)}
    rows, cols, _ = SMALL_GRID.cells(np.array([*places.values(), (0.25, -7.75)]))
    cells = dict(zip([*places, "nothing"], zip(rows, cols, strict=True), strict=True))
    assert {name: VERDICTS[maps.verdict[cell]] for name, cell in cells.items()} == {
        "wall": "hit", "before": "passed", "behind": "silent", "ground": "ground", "nothing": "silent",
    }  # fmt: skip
    assert maps.obstacles[cells["wall"]] == 25
    assert (maps.obstacles.sum(), maps.ground.sum()) == (len(wall), len(ground))
    assert maps.reach[cells["before"]] == pytest.approx(np.hypot(8.25, 0.2), abs=0.05)
    assert maps.distance[cells["behind"]] > maps.reach[cells["behind"]] > 8
    assert maps.reach[cells["nothing"]] == 0


class TestContributions:
    def test_are_gradient_times_input(self, story, told, net):
        result, why = told[-1], story.why
        o = result.belief.probability
        of_label, of_rival = (by_gradient(net, result.scores, o, story.cell, c) for c in (story.label, story.rival))
        planes, states = (a - b for a, b in zip(of_label, of_rival, strict=True))
        np.testing.assert_allclose(why.planes, planes.sum(axis=0), atol=1e-4)
        np.testing.assert_allclose(why.classes, planes.sum(axis=1), atol=1e-4)
        np.testing.assert_allclose(why.occupancy, states, atol=1e-4)

    def test_sum_to_the_logarithm_of_the_ratio_of_probabilities(self, story, told):
        why = story.why
        label, rival = told[-1].grid[[story.label, story.rival], *story.cell]
        assert why.score == pytest.approx(np.log(label / rival), abs=1e-3)
        assert why.planes.sum() + why.occupancy.sum() + why.rest == pytest.approx(why.score, abs=1e-4)
        assert why.classes.sum() == pytest.approx(why.planes.sum(), abs=1e-4)

    @pytest.mark.parametrize("changes", [{"uses_occupancy": False}, {"reduces": False}])
    def test_of_other_architectures(self, last_labelled, told, make_net, changes):
        net = make_net(last_labelled.camera, grid=SMALL_GRID, **changes)
        o = np.ascontiguousarray(told[-1].belief.probability[:, -32:, 15:47])
        planes, states = by_gradient(net, told[-1].scores, o, (12, 16), 3)
        parts = contributions(net, told[-1].scores, o)
        np.testing.assert_allclose(parts.planes[:, 3, 12, 16], planes.sum(axis=0), atol=1e-4)
        np.testing.assert_allclose(parts.occupancy[:, 3, 12, 16], states, atol=1e-4)
        assert states.any() == net.fusion.uses_occupancy

    def test_of_a_network_with_heights_leave_the_part_of_the_heights_in_the_rest(self, last_labelled, make_net):
        """Gradient times input by a backward pass; without a scan it takes every score on the ground."""
        net = with_fast_sampler(make_net(last_labelled.camera, uses_return_heights=True))
        (result,) = run_pipeline(last_labelled[:1], Stages.fast(net, PARAMS))
        told = frame_story(result, net)
        heights = cell_heights(result.frame.points_grid, SPEC)
        planes, states, z = fusion_inputs(net, result.scores, result.belief.probability, heights)
        planes.requires_grad_()
        states.requires_grad_()
        cell = (82, 25)
        logits = net.fusion(planes, states, z)[0, :, *cell]
        difference = logits[told.label[cell]] - logits[told.rival[cell]]
        gradients = torch.autograd.grad(difference, (planes, states))
        of_planes, of_states = ((g * x)[0].sum(dim=(-2, -1)) for g, x in zip(gradients, (planes, states), strict=True))
        why = told.why.at(cell)
        np.testing.assert_allclose(why.planes, of_planes.sum(dim=0).detach(), atol=1e-4)
        np.testing.assert_allclose(why.occupancy, of_states.detach(), atol=1e-4)
        assert why.planes.sum() + why.occupancy.sum() + why.rest == pytest.approx(difference.item(), abs=1e-3)
        unknown = torch.zeros_like(states)
        unknown[:, State.UNKNOWN] = 1
        blind = net.fusion(planes, unknown, torch.full_like(z, torch.nan))[0].argmax(dim=0)
        np.testing.assert_array_equal(told.otherwise["no occupancy"], blind)
        with pytest.raises(ArgumentError, match=r"return_heights: expected shape .*found none"):
            contributions(net, result.scores, result.belief.probability)

    def test_a_network_in_training_mode_is_refused(self, last_labelled, told):
        net = build_net(Architecture(), last_labelled.camera)
        with pytest.raises(ArgumentError, match="evaluation mode"):
            frame_story(told[0], net)


class TestNeighbours:
    RNG = np.random.default_rng(2)
    STATES = RNG.dirichlet(np.full(4, 0.4), (14, 11)).transpose(2, 0, 1)
    G = RNG.dirichlet(np.ones(5), (14, 11)).transpose(2, 0, 1)

    @pytest.mark.parametrize("normalization", ["symmetric", "none"])
    def test_are_those_of_the_matrix_of_all_pairs(self, normalization):
        params = CrfParams(sigma_alpha=3.2, sigma_gamma=1.2, normalization=normalization)
        label = self.G.argmax(axis=0)
        found = neighbour_pull(self.G, label, self.STATES, params)
        weights = pair_weights(self.STATES, params)
        np.testing.assert_allclose(found.messages, (self.G.reshape(5, -1) @ weights).reshape(self.G.shape), rtol=1e-6)
        for cell in [(0, 0), (7, 5), (13, 10), (3, 9)]:
            terms = weights[cell[0] * 11 + cell[1]] * self.G[label[cell]].ravel()
            best = np.argsort(-terms, kind="stable")[:5]
            np.testing.assert_allclose(found.pull[:, *cell], terms[best], rtol=1e-6)
            np.testing.assert_array_equal(found.steps[:, :, *cell].T + cell, np.argwhere(label >= 0)[best])

    def test_explain_the_fast_crf_too(self, story):
        """Of the last update of a cell: all but how far it goes, which is nearly all the way."""
        updated = softmax(np.log(story.before) + story.messages)
        np.testing.assert_allclose(updated, story.after, atol=0.1)


class TestStory:
    def test_holds_the_pipelines_own_results(self, story, told, last_labelled):
        result = told[-1]
        assert story.label == result.grid[:, *story.cell].argmax()
        assert story.refined == result.refined[:, *story.cell].argmax()
        np.testing.assert_array_equal(story.after, result.refined[:, *story.cell])
        for name, states in {**result.belief.steps, "shown": result.belief.probability}.items():
            np.testing.assert_array_equal(story.steps[name], states[:, *story.cell])
            assert story.steps[name].sum() == pytest.approx(1, abs=1e-5)
        assert story.truth == grid_truth(result.frame.labels, result.belief.probability, SPEC)[story.cell]
        pixels, visible = plane_pixels(SPEC, story.heights, last_labelled.camera)
        np.testing.assert_array_equal(story.pixels, pixels[:, *story.cell])
        np.testing.assert_array_equal(story.visible, visible[:, *story.cell])

    def test_history_ends_with_now_and_sums_to_one(self, story):
        assert story.history.shape == (4, 3)
        np.testing.assert_array_equal(story.history[:, -1], story.steps["shown"])
        np.testing.assert_allclose(story.history.sum(axis=0), 1, atol=1e-5)
        np.testing.assert_allclose(np.diff(story.times), 0.1, atol=1e-6)

    def test_the_vehicle_drives_a_metre_a_frame_so_the_place_was_two_rows_further_ahead(self, told):
        _, history = place_history(told, SPEC, (90, 30))
        rows = [90 - round(STEP / SPEC.cell) * (len(told) - 1 - k) for k in range(len(told))]
        expected = [result.belief.probability[:, row, 30] for row, result in zip(rows, told, strict=True)]
        np.testing.assert_array_equal(history, np.stack(expected, axis=1))
        _, history = place_history(told, SPEC, (1, 30))
        np.testing.assert_array_equal(history[:, 0], [0, 0, 0, 1])  # it was outside the grid

    def test_a_class_is_compared_with_the_truth_or_with_the_second_best(self, story_maps, told):
        second = np.argsort(-told[-1].grid, axis=0, kind="stable")[1]
        wrong = (story_maps.truth != story_maps.label) & (story_maps.truth < 255)
        np.testing.assert_array_equal(story_maps.rival, np.where(wrong, story_maps.truth, second))
        assert 0 < wrong.sum() < wrong.size

    def test_another_network_is_refused(self, told, last_labelled):
        other = build_net(Architecture(), last_labelled.camera, seed=9).eval()
        with pytest.raises(ArgumentError, match="network that made the result"):
            cell_story(told[-1], (100, 30), other)

    @pytest.mark.parametrize("cell", [(-1, 0), (142, 0), (0, 62), (1.5, 2.5), (3.0, 4), (1,), (1, 2, 3), 5, None, "ab"])
    def test_a_cell_outside_the_grid_is_refused(self, told, net, cell):
        with pytest.raises(ArgumentError, match="row and column"):
            cell_story(told[-1], cell, net)

    def test_is_told_without_steps_labels_and_memory_too(self, told, net):
        result = told[0]
        plain = dataclasses.replace(result, belief=dataclasses.replace(result.belief, steps={}), remembered=None)
        story = cell_story(plain, (90, 30), net)
        assert list(story.steps) == ["shown"]
        assert (story.truth, story.fault) == (None, "none")

    def test_no_stage_is_charged_where_nobody_labelled_the_cell(self, story_maps):
        """There the truth is the filter's own state, so an answer may differ from it and be no mistake."""
        maps = story_maps
        unlabelled = maps.truth >= KITTI_14.n_semantic
        assert (unlabelled & (maps.refined != maps.truth)).any()
        assert (maps.fault[unlabelled] == FAULTS.index("none")).all()
        assert (maps.fault[~unlabelled] != FAULTS.index("none")).any()
