"""A cell's story in sentences, written independently of the page's script, which must say the same."""

from collections import Counter
from collections.abc import Iterable
from types import SimpleNamespace

from semgrid_edu.labels import KITTI_14
from semgrid_edu.occupancy import State
from semgrid_edu.workshop.demo.details import SENTENCES
from semgrid_edu.workshop.demo.stories import CellStory
from semgrid_edu.workshop.demo.what_if import NO_IMAGE, NO_OCCUPANCY, TRUE_BOTH


def told_story(story: CellStory, memory: SimpleNamespace | None = None) -> list[str]:
    """The sentences that the page's panel shows for a cell; `memory` is from `memory_of`."""
    return list(filter(None, (_fault(story), _image(story), _memory(story, memory), _otherwise(story))))


def memory_of(remembered, sight, cell: tuple[int, int], earlier: int) -> SimpleNamespace:
    """What a cell is called with memory, and when one of the frames last gave its place a class by itself."""
    distribution = remembered[:, *cell]
    back, seconds, then = (values[cell].item() for values in sight)
    label = int(distribution.argmax())
    probability = float(distribution[label])
    return SimpleNamespace(label=label, probability=probability, back=back, seconds=seconds, then=then, earlier=earlier)


def counted(classes: Iterable[int], names: tuple[str, ...]) -> str:
    """How often each class occurs, the most frequent first; a number without a name isn't counted."""
    found = Counter(int(c) for c in classes if 0 <= c < len(names))
    return ", ".join(f"{names[c]} ({number})" for c, number in sorted(found.items(), key=lambda one: (-one[1], one[0])))


def _classes(story: CellStory) -> dict[str, str | None]:
    """The names of the classes that the sentences mention."""
    truth = None if story.truth is None else story.names[story.truth]
    return {"label": story.names[story.label], "refined": story.names[story.refined], "truth": truth}


def _fault(story: CellStory) -> str:
    if story.fault == "none":
        return ""
    words = _classes(story)
    words["for_refined"] = f"{story.messages[story.refined]:.1f}"
    words["for_truth"] = f"{story.messages[story.truth]:.1f}"
    words["all_true"] = story.names[story.otherwise[TRUE_BOTH]]
    words["image_here"] = _image_here(story)
    words["occupancy_here"] = _occupancy_here(story)
    return SENTENCES["fault"][story.fault].format(**words)


def _image_here(story: CellStory) -> str:
    """Whether the image network is right at the pixels above the cell."""
    labelled = story.shown < len(story.names)
    wrong = int((story.called != story.shown)[labelled].sum())
    case = "wrong" if wrong else "right" if labelled.any() else "unknown"
    return SENTENCES["image_here"][case].format(wrong=wrong, labelled=int(labelled.sum()))


def _occupancy_here(story: CellStory) -> str:
    """Whether the filter is right about the cell: the ground should be FREE, and a thing shouldn't."""
    state = State(int(story.steps["shown"].argmax()))
    if state == State.UNKNOWN:
        return SENTENCES["occupancy_here"]["unknown"]
    wrong = (story.names[story.truth] in KITTI_14.flat) != (state == State.FREE)
    case = "wrong" if wrong else "right"
    return SENTENCES["occupancy_here"][case].format(state=state.name)


def _image(story: CellStory) -> str:
    words = SENTENCES["image"]
    points = {
        "points": len(story.heights),
        "lowest": f"{story.heights[0]:.1f}",
        "highest": f"{story.heights[-1]:.1f}",
    }
    if not story.visible.any():
        return words["none"].format(**points)
    says = counted(story.called[story.visible], story.names)
    shows = counted(story.shown[story.visible], story.names)
    said = words["some"].format(seen=int(story.visible.sum()), says=says, **points)
    if not shows:
        return said
    partly = (story.shown[story.visible] >= len(story.names)).any()
    return f"{said} {words['partly' if partly else 'shown'].format(shows=shows)}"


def _memory(story: CellStory, memory: SimpleNamespace | None) -> str:
    if memory is None:
        return ""
    words = SENTENCES["memory"]
    case = "never" if memory.back < 0 else "before" if memory.back else "now"
    said = words[case].format(
        kept=story.names[memory.label],
        then=story.names[memory.then],
        label=story.names[story.label],
        sure=round(100 * memory.probability),
        seconds=f"{memory.seconds:.1f}",
        back=memory.back,
        earlier=memory.earlier,
    )
    return f"{said} {words['moves']}" if story.steps["shown"][State.DYNAMIC] > 0.5 else said


def _otherwise(story: CellStory) -> str:
    no_image, no_occupancy = (story.names[story.otherwise[change]] for change in (NO_IMAGE, NO_OCCUPANCY))
    return SENTENCES["otherwise"]["removed"].format(no_image=no_image, no_occupancy=no_occupancy)
