"""A cell's story in words: what it is called, which stage went wrong, and what each stage saw (paper, Fig. 2)."""

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.labels import IGNORE
from semgrid_edu.occupancy import State
from semgrid_edu.storage.files import table_beside
from semgrid_edu.story.what_if import NO_IMAGE, NO_OCCUPANCY, TRUE_BOTH, TRUE_IMAGE, TRUE_OCCUPANCY

SENTENCES = table_beside(__file__)
"""The sentences by part and case, from `words.toml`; names in braces are filled in."""


FAULTS = tuple(SENTENCES["fault"])
"""The stages that can have gone wrong, in the order of their numbers."""


def faults(
    label: ArrayLike, refined: ArrayLike, truth: ArrayLike, otherwise: Mapping[str, ArrayLike]
) -> NDArray[np.int64]:
    """Return which stage went wrong in each cell, as an index of `FAULTS`.

    A stage went wrong if the class before the CRF is right as soon as what the stage hands on is put right. So no stage
    is charged with an error that the next ones would have overcome, and two stages can have gone wrong.

    Parameters
    ----------
    label, refined : (...) int
        The class of each cell before and after the CRF.
    truth : (...) int
        The true class; 255 where it isn't known.
    otherwise : dict of str to (...) int
        What each cell is called when an input changes, see `what_if`.

    Returns
    -------
    (...) int64

    Examples
    --------
    >>> FAULTS[faults(0, 0, 3, {"true image": 3, "true occupancy": 0, "both true": 3})]
    'image'
    """
    label, refined, truth = map(np.asarray, (label, refined, truth))
    if TRUE_BOTH not in otherwise:
        return np.zeros(truth.shape, np.int64)
    image, occupancy, both = (np.equal(otherwise[change], truth) for change in (TRUE_IMAGE, TRUE_OCCUPANCY, TRUE_BOTH))
    cases = {
        "none": (truth == IGNORE) | ((label == truth) & (refined == truth)),
        "mended": refined == truth,
        "crf": label == truth,
        "either": image & occupancy,
        "image": image,
        "occupancy": occupancy,
        "both": both,
    }
    return np.select(list(cases.values()), [FAULTS.index(name) for name in cases], FAULTS.index("fusion"))


def story_text(story: Any) -> str:
    """Tell a cell's story in sentences, the numbers last.

    Parameters
    ----------
    story : CellStory
        The story; `str(story)` is the same. (Typed as anything: the class imports this module.)
    """
    parts = (_place, _called, _fault, _image, _memory, _scan, _otherwise, _numbers)
    return "\n".join(filter(None, (part(story) for part in parts)))


def counted(classes: Iterable[int], names: tuple[str, ...]) -> str:
    """Return how often each class occurs, the most frequent first.

    Parameters
    ----------
    classes : iterable of int
        Class numbers; a number without a name isn't counted.
    names : tuple of str
        The names of the classes.

    Examples
    --------
    >>> counted([0, 3, 3, 255], ("road", "sidewalk", "vegetation", "car"))
    'car (2), road (1)'
    """
    found = Counter(int(c) for c in classes if 0 <= c < len(names))
    return ", ".join(f"{names[c]} ({number})" for c, number in sorted(found.items(), key=lambda one: (-one[1], one[0])))


def _place(story: Any) -> str:
    (row, col), (x, y) = story.cell, story.xy
    side = "right" if y < 0 else "left"
    return SENTENCES["place"]["cell"].format(row=row, col=col, ahead=f"{x:.1f}", aside=f"{abs(y):.1f}", side=side)


def _called(story: Any) -> str:
    case = "unsure" if story.truth is None else "right" if story.refined == story.truth else "wrong"
    sure = round(100 * float(story.pull.after[story.refined]))
    return SENTENCES["called"][case].format(sure=sure, **_classes(story))


def _classes(story: Any) -> dict[str, str]:
    """Return the names of the classes that the sentences speak of."""
    truth = None if story.truth is None else story.names[story.truth]
    return {"label": story.names[story.label], "refined": story.names[story.refined], "truth": truth}


def _fault(story: Any) -> str:
    adds = story.pull.messages
    numbers = {"for_refined": f"{adds[story.refined]:.1f}"}
    if story.truth is not None:
        numbers["for_truth"] = f"{adds[story.truth]:.1f}"
    if TRUE_BOTH in story.otherwise:
        numbers["all_true"] = story.names[story.otherwise[TRUE_BOTH]]
        numbers |= {"image_here": _image_here(story), "occupancy_here": _occupancy_here(story)}
    return SENTENCES["fault"][story.fault].format(**numbers, **_classes(story))


def _image_here(story: Any) -> str:
    """Say whether the image network is right at the pixels above the cell."""
    labelled = story.pixel_truth < len(story.names)
    wrong = int((story.pixel_classes != story.pixel_truth)[labelled].sum())
    case = "wrong" if wrong else "right" if labelled.any() else "unknown"
    return SENTENCES["image_here"][case].format(wrong=wrong, labelled=int(labelled.sum()))


def _occupancy_here(story: Any) -> str:
    """Say whether the filter is right about the cell: what lies on the ground is FREE, what stands there isn't."""
    state = State(int(story.steps["shown"].argmax()))
    if state == State.UNKNOWN:
        return SENTENCES["occupancy_here"]["unknown"]
    free = story.names[story.truth] in story.flat
    semantic = not story.names[story.truth].startswith("unknown")
    case = "wrong" if semantic and free != (state == State.FREE) else "right"
    return SENTENCES["occupancy_here"][case].format(state=state.name)


def _image(story: Any) -> str:
    words, (lowest, highest) = SENTENCES["image"], (f"{story.heights[end]:.1f}" for end in (0, -1))
    points = {"points": len(story.heights), "lowest": lowest, "highest": highest}
    if not story.visible.any():
        return words["none"].format(**points)
    says, shows = (counted(c[story.visible], story.names) for c in (story.pixel_classes, story.pixel_truth))
    said = words["some"].format(seen=int(story.visible.sum()), says=says, **points)
    partly = (story.pixel_truth[story.visible] >= len(story.names)).any()
    return f"{said} {words['partly' if partly else 'shown'].format(shows=shows)}" if shows else said


def _memory(story: Any) -> str:
    if (memory := story.memory) is None:
        return ""
    case = "never" if memory.back < 0 else "before" if memory.back else "now"
    classes = {"kept": story.names[memory.label], "then": story.names[memory.then], "label": story.names[story.label]}
    numbers = {"sure": round(100 * memory.sure), "seconds": f"{memory.seconds:.1f}", "back": memory.back}
    said = SENTENCES["memory"][case].format(earlier=memory.earlier, **classes, **numbers)
    return f"{said} {SENTENCES['memory']['moves']}" if story.steps["shown"][State.DYNAMIC] > 0.5 else said


def _scan(story: Any) -> str:
    words, scan = SENTENCES["scan"], story.scan
    returns = len(scan.obstacles if scan.verdict == "hit" else scan.ground)
    states = ", ".join(f"{s.name} {100 * story.steps['shown'][s]:.0f} %" for s in State)
    return f"{words[scan.verdict].format(returns=returns)} {words['states'].format(states=states)}"


def _otherwise(story: Any) -> str:
    no_image, no_occupancy = (story.names[story.otherwise[change]] for change in (NO_IMAGE, NO_OCCUPANCY))
    return SENTENCES["otherwise"]["removed"].format(no_image=no_image, no_occupancy=no_occupancy)


def _numbers(story: Any) -> str:
    why = story.for_label.minus(story.for_rival)
    parts = {"planes": why.planes.sum(), "occupancy": why.occupancy.sum(), "rest": why.rest, "score": why.score}
    names = {"label": story.names[story.label], "rival": story.names[story.rival]}
    return SENTENCES["numbers"]["sum"].format(**names, **{name: f"{part:+.1f}" for name, part in parts.items()})
