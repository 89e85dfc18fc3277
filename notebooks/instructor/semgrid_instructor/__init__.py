"""Hidden tests of the exercises: on the instructor's machine only, never in what students get.

A hidden test cell calls one function of a module here and asserts that it returns an empty string. nbgrader's
feedback pages print a failed cell and its traceback in full; a returned sentence keeps the inputs and the right
answers out of them. For the same reason the answer works in a process of which the student is shown nothing (`unseen`).
"""

import copy
import functools
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from semgrid_edu.workshop.course.sandbox.session import AnswerEndedError, AnswerTimeoutError

_variant: list[int] = []


def choose_variant(*number: int) -> None:
    """Let hidden tests draw the inputs of this number from now on, or without a number the usual ones."""
    _variant[:] = number


def generator(seed: int) -> np.random.Generator:
    """Return the generator from which a hidden test draws its inputs, by the variant that was chosen last."""
    return np.random.default_rng([seed, *_variant])


def in_any_order(cases: Iterable) -> list:
    """Return cases in an order that is never the same, so that no answer knows which one it is asked."""
    cases = list(cases)
    return [cases[k] for k in np.random.default_rng().permutation(len(cases))]


def asked_in_any_order(ask: Callable[[Any], Any], cases: Iterable) -> list[tuple[Any, Any]]:
    """Return each case with what an answer says to it: asked as by `in_any_order`, judged always in the same order."""
    cases = list(cases)
    said = {k: ask(cases[k]) for k in in_any_order(range(len(cases)))}
    return [(case, said[k]) for k, case in enumerate(cases)]


def close(got: ArrayLike, wanted: ArrayLike, rtol: float = 1e-5, atol: float = 1e-6, equal_nan: bool = False) -> bool:
    """Return whether two results have one shape, which isn't empty, and the same numbers as far as float32 can tell.

    `np.allclose` says yes when one of them is empty, and when shapes differ but can be broadcast. A plain number as
    `wanted` stands for an array that is full of it.
    """
    if type(wanted) in (int, float):
        wanted = np.full(np.shape(got), wanted)
    same = np.shape(got) == np.shape(wanted) and np.size(got) > 0
    return same and np.allclose(got, wanted, rtol, atol, equal_nan)


def keeping(check: Callable[..., None]) -> Callable[..., None]:
    """Let a check fail when the answer changes one of its arguments, where the exercise asks it not to."""

    @functools.wraps(check)
    def checked(answer: Callable, *others: Callable) -> None:
        def kept(*arguments: Any, **named: Any) -> Any:
            before = copy.deepcopy((arguments, named))
            result = answer(*arguments, **named)
            try:
                np.testing.assert_equal((arguments, named), before)
            except AssertionError:
                raise AssertionError("it changes an argument: make new arrays") from None
            return result

        check(kept, *others)

    return checked


def hidden(check: Callable[..., None]) -> Callable[..., str]:
    """Turn a check that raises into one that returns a short complaint about the first answer, "" when all is well.

    Of an answer that works in another process, the check waits until nothing more of that process is shown.
    """

    @functools.wraps(check)
    def complaint(*answers: Callable) -> str:
        later = next((one.judge_later for one in answers if hasattr(one, "judge_later")), lambda judge: judge())
        return later(lambda: _complaint(check, *answers))

    return complaint


def _complaint(check: Callable[..., None], answer: Callable, *others: Callable) -> str:
    """Check answers where nobody sees them; return one sentence, without the inputs and what came of them."""
    about = f"{answer.__name__}, on inputs you haven't seen:"
    try:
        check(*(getattr(one, "unseen", one) for one in (answer, *others)))
    except AssertionError as error:
        return f"{about} {error}"
    except AnswerTimeoutError:
        return f"{about} it does not come to an end"
    except AnswerEndedError:
        return f"{about} it ends Python itself"
    except Exception as error:
        return f"{about} it raises {getattr(error, 'secret', 'an error')}"
    return ""
