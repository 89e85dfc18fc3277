"""What a stage hands on is checked, whoever wrote it, and the errors name the cause."""

from functools import partial, wraps
from itertools import chain

import numpy as np
import pytest
import torch
from tiny_drive import DATE, write_tiny_drive

from semgrid_edu.crf import mean_field
from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks import Architecture
from semgrid_edu.occupancy import Belief
from semgrid_edu.pipeline import StageError, Stages, run_pipeline
from semgrid_edu.stages.checks import is_ours
from semgrid_edu.stages.hints import where

C, D, GRID, IMAGE = 14, 2, (3, 5), (6, 20)
ARCHITECTURE = Architecture(image_size=IMAGE, grid=GridSpec(0, 3, -2.5, 2.5, 1), heights=(0.0, 1.0))
EVENLY = np.full((4, *GRID), 0.25, np.float32)
RIGHT = {
    "segment": np.zeros((C, *IMAGE)),
    "sample": np.zeros((C, D, *GRID)),
    "fuse": np.full((C, *GRID), -np.log(C)),
    "refine": np.full((C, *GRID), 1 / C),
}


def evenly(frames, spec):
    for _ in frames:
        yield EVENLY


def stages_with(**functions):
    constant = {name: (lambda *_, value=value: value) for name, value in RIGHT.items()}
    return Stages(**({"track": evenly} | constant | functions), architecture=ARCHITECTURE)


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    root = tmp_path_factory.mktemp("drive")
    write_tiny_drive(root)
    return KittiRawDrive(root, DATE, "0001")[:]


def changed(stage, cell, values):
    wrong = RIGHT[stage].copy()
    wrong[..., *cell] = values
    return wrong


def test_what_is_right_passes_in_any_float_and_layout(frames):
    for kind in (np.float16, np.float32, np.float64):
        turned = {
            name: (lambda *_, value=value: np.asfortranarray(value.astype(kind))[:, ::-1])  # noqa: B023
            for name, value in RIGHT.items()
        }
        for result in run_pipeline(frames, stages_with(**turned)):
            np.testing.assert_allclose(result.refined, 1 / C, rtol=1e-3)
            assert result.refined.dtype == result.grid.dtype == result.scores.dtype == np.float32


@pytest.mark.parametrize(
    ("stage", "returned", "message"),
    [
        (
            "refine",
            np.zeros((*GRID, C)),
            r"expected shape \(14, 3, 5\), found shape \(3, 5, 14\): is the class axis last",
        ),
        ("refine", np.zeros(GRID), r"found shape \(3, 5\): is this one label in each place"),
        ("refine", np.zeros((1, C, *GRID)), r"found shape \(1, 14, 3, 5\): is this a batch of one"),
        ("fuse", np.zeros((C, 5, 3)), r"found shape \(14, 5, 3\): are rows and columns swapped"),
        ("sample", np.zeros((D, C, *GRID)), r"found shape \(2, 14, 3, 5\): are the axes in another order"),
        ("segment", np.zeros((13, *IMAGE)), r"expected shape \(14, 6, 20\), found shape \(13, 6, 20\)$"),
        ("refine", np.zeros((C, *GRID), int), r"expected floating-point numbers, found int64"),
        ("refine", None, r"expected a numpy array, found None: is the `return` missing"),
        ("segment", torch.zeros(C, *IMAGE), r"found a torch Tensor: end with"),
        ("sample", (i for i in "s"), r"found a generator: this stage returns its result"),
        ("refine", [1.0], r"expected a numpy array, found list"),
        ("segment", changed("segment", (2, 3), np.inf), r"expected finite numbers, found inf at index \(0, 2, 3\)"),
        (
            "refine",
            changed("refine", (1, 4), 0.5),
            r"the 14 classes of cell \(1, 4\) sum to 7: did you normalise over the",
        ),
        ("refine", changed("refine", (1, 4), np.nan), r"cell \(1, 4\) sum to nan: was something divided by a sum of 0"),
        ("refine", changed("refine", (2, 0), [-1, 2] + 12 * [0]), r"from 0 to 1, found -1 in cell \(2, 0\)"),
        ("refine", RIGHT["fuse"], r"are these log-probabilities\? Return np.exp of them"),
        ("fuse", RIGHT["refine"], r"are these probabilities\? Return np.log of them"),
        ("fuse", np.ones((C, *GRID)), r"exp of the 14 classes of cell \(0, 0\) sums to 38.06: are these scores"),
        ("fuse", changed("fuse", (0, 1), np.nan), r"cell \(0, 1\) sums to nan: is there a logarithm of a negative"),
    ],
)
def test_what_a_stage_returns_is_refused_with_its_probable_cause(frames, stage, returned, message):
    with pytest.raises(StageError, match=message) as caught:
        next(run_pipeline(frames, stages_with(**{stage: lambda *_: returned})))
    assert str(caught.value).startswith(f"{stage} (test_checks.py, line ")


@pytest.mark.parametrize(
    ("yielded", "message"),
    [
        (EVENLY * 2, r"the 4 states of cell \(0, 0\) sum to 2: did you normalise over the state axis \(axis 0\)\?"),
        (EVENLY.transpose(1, 2, 0), r"found shape \(3, 5, 4\): is the state axis last"),
        (Belief(EVENLY, EVENLY[:2].transpose(1, 2, 0), None), r"shape \(3, 5, 2\): is the velocity axis last"),
        (None, r"expected a numpy array, found None"),
    ],
)
def test_what_a_tracker_yields_is_refused_with_its_probable_cause(frames, yielded, message):
    def track(frames, spec):
        for _ in frames:
            yield yielded

    with pytest.raises(StageError, match=rf"^track \(test_checks.py, line \d+\), frame 0: .*{message}"):
        next(run_pipeline(frames, stages_with(track=track)))


def test_nan_among_the_planes_is_blamed_on_the_stage_that_made_them(frames):
    stages = stages_with(
        sample=lambda s: changed("sample", (1, 2), np.nan),
        fuse=lambda p, o: RIGHT["fuse"] + p.sum(axis=1),
    )
    with pytest.raises(StageError, match=r"^sample .* expected finite numbers, found nan at index \(0, 0, 1, 2\)"):
        next(run_pipeline(frames, stages))


def test_a_stage_that_calls_sys_exit_is_named(frames):
    def refine(log_g, o):
        raise SystemExit("bye")

    with pytest.raises(StageError, match=r"refine .*frame 0: expected a result, found an error: SystemExit: bye"):
        list(run_pipeline(frames, stages_with(refine=refine)))


def test_an_exception_is_chained_and_says_which_stage_and_frame(frames):
    seen = []

    def refine(log_g, o):
        seen.append(o)
        if len(seen) == 2:
            raise KeyError("car")
        return np.exp(log_g)

    line = refine.__code__.co_firstlineno
    message = (
        rf"^refine \(test_checks.py, line {line}\), frame 1: .* KeyError: 'car' \(test_checks.py, line {line + 3}\)$"
    )
    with pytest.raises(StageError, match=message) as caught:
        list(run_pipeline(frames, stages_with(refine=refine)))
    assert isinstance(caught.value.__cause__, KeyError)


class TestTracker:
    """It takes one frame, yields its belief, and only then takes the next."""

    @staticmethod
    def fails(frames, track, message):
        with pytest.raises(StageError, match=rf"^track \(test_checks.py, line \d+\), {message}"):
            list(run_pipeline(frames, stages_with(track=track)))

    def test_that_reads_ahead(self, frames):
        def track(frames, spec):
            for _ in list(frames):
                yield EVENLY

        self.fails(
            frames, track, "frame 0: .*found one that takes another frame before it yields .* make a list of them"
        )

    def test_that_returns_a_list(self, frames):
        def track(frames, spec):
            return [EVENLY for _ in frames]

        self.fails(frames, track, "frame 0: .*found one that takes another frame before .*: is the `yield` missing")

    def test_that_ends_early(self, frames):
        def track(frames, spec):
            next(frames)
            yield EVENLY

        self.fails(frames, track, "frame 1: expected a belief for each frame, found the end")

    def test_that_yields_twice(self, frames):
        def track(frames, spec):
            for _ in frames:
                yield EVENLY
                yield EVENLY

        self.fails(frames, track, "frame 1: .*found a belief before it took the frame: does it yield twice")

    def test_that_returns_an_array(self, frames):
        self.fails(frames, lambda frames, spec: EVENLY, "frame 0: .*found ndarray: is the `yield` missing")

    def test_that_raises(self, frames):
        def track(frames, spec):
            for _ in frames:
                yield EVENLY / 0 if spec is None else [][0]

        self.fails(frames, track, "frame 0: .*IndexError: list index out of range")

    def test_that_takes_its_first_frame_before_it_makes_the_generator(self, frames):
        def track(frames, spec):
            first = next(frames)
            return (EVENLY for _ in chain([first], frames))

        assert len(list(run_pipeline(frames, stages_with(track=track)))) == len(frames)

    def test_sees_the_frames_of_the_drive_in_turn(self, frames):
        times = []

        def track(frames, spec):
            for frame in frames:
                times.append((frame.time, spec))
                yield EVENLY

        for result in run_pipeline(frames, stages_with(track=track)):
            assert times[-1] == (result.frame.time, ARCHITECTURE.grid)
            assert np.isnan(result.belief.velocity).all()
        assert len(times) == len(frames)


class CountsFrames:
    """A tracker as an object: as many cells are free as it has seen frames."""

    def __init__(self):
        self.seen = 0

    def step(self, frame):
        belief = EVENLY.copy()
        belief[:, 0, : self.seen] = np.eye(4)[0][:, None]
        self.seen += 1
        return belief


def test_an_object_with_step_starts_every_drive_as_it_was_handed_over(frames):
    stages = stages_with(track=CountsFrames())
    for _ in range(2):
        free = [int((r.belief.probability[0] == 1).sum()) for r in run_pipeline(frames, stages)]
        assert free == [0, 1, 2]
    assert stages.track.seen == 0


def test_what_an_object_with_step_raises_is_named(frames):
    class Broken(CountsFrames):
        def step(self, frame):
            return [][0]

    with pytest.raises(StageError, match=r"^track \(test_checks.py, line \d+\), frame 0: .*IndexError"):
        next(run_pipeline(frames, stages_with(track=Broken())))


class TestArraysOfItsOwn:
    """A function may change what it gets, and give the same array again."""

    def test_what_goes_in(self, frames):
        def refine(log_g, o):
            log_g[:], o[:] = np.nan, np.nan
            return RIGHT["refine"]

        def sample(s):
            s[:] = np.nan
            return RIGHT["sample"]

        for result in run_pipeline(frames, stages_with(refine=refine, sample=sample)):
            np.testing.assert_array_equal(result.belief.probability, EVENLY)
            np.testing.assert_allclose(result.grid, 1 / C, rtol=1e-6)
            np.testing.assert_array_equal(result.scores, 0)

    def test_what_a_stage_with_a_memory_gets(self, frames):
        def track(frames, spec):
            for frame in frames:
                frame.image[:] = 0
                yield EVENLY

        def remember(views, spec):
            for view in views:
                view.belief.probability[:] = np.nan
                view.frame.points[:] = np.nan
                yield RIGHT["refine"]

        for result in run_pipeline(frames, stages_with(track=track, remember=remember)):
            np.testing.assert_array_equal(result.belief.probability, EVENLY)
            assert np.isfinite(result.frame.points).all()
            assert result.frame.image.any()

    def test_what_comes_out(self, frames):
        def track(frames, spec):
            belief = np.zeros_like(EVENLY)
            for k, frame in enumerate(frames):
                frame.points[:] = 0
                belief[:] = 0
                belief[k] = 1
                yield belief

        results = list(run_pipeline(frames, stages_with(track=track)))
        assert [result.belief.probability[:, 0, 0].argmax() for result in results] == [0, 1, 2]
        assert all(result.frame.points.any() for result in results)


class TestFunctions:
    @pytest.mark.parametrize(
        ("name", "function", "message"),
        [
            ("refine", lambda log_g: log_g, r"refine: expected a function refine\(log_g, o\), found refine\(log_g\)"),
            ("segment", lambda: None, r"segment: expected a function segment\(image\), found segment\(\)"),
            (
                "track",
                "cmcdot",
                r"track: expected a function track\(frames, spec\) or an object with step\(frame\), found a str",
            ),
        ],
    )
    def test_that_cannot_be_called_are_refused_at_once(self, name, function, message):
        with pytest.raises(ArgumentError, match=message):
            Stages(**{name: function})

    def test_with_defaults_or_any_number_of_arguments_will_do(self):
        assert Stages(refine=lambda log_g, o, width=1: log_g, sample=lambda *s: s).given == ("sample", "refine")

    def test_are_found_where_they_are_written(self):
        line = evenly.__code__.co_firstlineno
        assert where(evenly) == where(partial(evenly, spec=None)) == f"test_checks.py, line {line}"
        assert where(Stages()) == "an object of class Stages"

    def test_that_wrap_one_of_the_packages_are_still_ones_own(self):
        @wraps(mean_field)
        def refine(log_g, o):
            return log_g

        assert is_ours(mean_field)
        assert not is_ours(refine)

    def test_and_so_are_objects_that_can_be_called(self, frames):
        class Refine:
            def __call__(self, log_g, o):
                raise KeyError("car")

        line = Refine.__call__.__code__.co_firstlineno
        message = rf"^refine \(test_checks.py, line {line}\), .* KeyError: 'car' \(test_checks.py, line {line + 1}\)$"
        with pytest.raises(StageError, match=message):
            next(run_pipeline(frames, stages_with(refine=Refine())))

    def test_classes_are_no_functions(self):
        with pytest.raises(ArgumentError, match=r"found the class Refine itself: write refine = Refine\("):
            Stages(refine=type("Refine", (), {}))


@pytest.mark.parametrize("other", [Stages(architecture=Architecture()), Stages()])
def test_stages_of_different_architectures_are_not_mixed(other):
    with pytest.raises(ArgumentError, match=r"^architecture: expected that of the other stages, .*\(96, 320\)"):
        Stages(track=evenly, architecture=ARCHITECTURE).over(other)
