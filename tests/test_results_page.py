"""docs/results.md quotes the committed results."""

import json
from pathlib import Path

import pytest
from worlds.lecture_08_counts import by_camera, counts_of_text, named

from semgrid_edu.metrics import METRICS
from semgrid_edu.workshop.scoring.statistics import paired_interval

DOCS = Path(__file__).parents[1] / "docs"
SHOWN = ("pixel accuracy", "class accuracy")
NETWORK, FORBIDDEN = "network", ", unknown forbidden"


def table(heading):
    """The cells of the table below a heading, row by row."""
    section = (DOCS / "results.md").read_text(encoding="utf-8").split(f"## {heading}")[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")][2:]
    return [[cell.strip(" *") for cell in line.split("|")[1:-1]] for line in lines]


def scores(name):
    return json.loads((DOCS / "results" / f"{name}.json").read_text(encoding="utf-8"))["scores"]


def per_cent(share):
    return f"{100 * share:.1f}"


def interval(score):
    return f"{per_cent(score['mean'])} ({per_cent(score['low'])} to {per_cent(score['high'])})"


def over(split, method, rival):
    """By metric how far a method is ahead of a rival, with its interval over cameras, from the committed counts."""
    texts = json.loads((DOCS / "results" / "camera_worth_heights.json").read_text(encoding="utf-8"))["counts"][split]
    counts = [by_camera({c: counts_of_text(frames) for c, frames in texts[name].items()}) for name in (method, rival)]
    return {metric: interval(named(paired_interval(*counts, METRICS[metric]))) for metric in SHOWN}


def points(text):
    """An interval as it stands in a sentence."""
    return text.replace(" (", " points (", 1)


def test_the_camera_beside_rules_without_one():
    left_out, later = scores("camera_worth_heights").values()
    page = (DOCS / "results.md").read_text(encoding="utf-8")
    for name, *quoted in table("A real street"):
        assert quoted == [interval(left_out[name][metric]) for metric in SHOWN]
    free, bound, rule, forest = NETWORK, NETWORK + FORBIDDEN, "height rule", "forest on heights and o"
    new, known = "each pair of cameras left out", "later"
    cells, classes = SHOWN
    below = over(new, free, rule)[cells]
    assert f"it is {points(below).removeprefix('-')}: *unknown*".replace("points", "points below the rule") in page
    above_rule, above_forest = over(new, bound, rule)[cells], over(new, bound, forest)[cells]
    assert (
        f"it is {above_rule.replace(' ', ' above ', 1)}, and {above_forest.replace(' ', ' above the forest ', 1)}"
        in page
    )
    refined = [per_cent(left_out[f"{NETWORK} + CRF{end}"][cells]["mean"]) for end in ("", FORBIDDEN)]
    above = over(new, f"{NETWORK} + CRF{FORBIDDEN}", rule)[cells].replace(" ", " above the rule ", 1)
    assert f"it gets {refined[0]} %, or {refined[1]} with *unknown* forbidden, which is {above}" in page
    sure, unsure, lazy, trees = (per_cent(later[name][cells]["mean"]) for name in (bound, free, rule, forest))
    said = f"it gets {unsure} %, or {sure} with *unknown* forbidden; the rule gets {lazy} and the forest {trees}."
    assert said in page
    ahead = [over(known, free, forest)[cells], over(known, bound, forest)[cells], over(known, free, forest)[classes]]
    assert f"the forest by {points(ahead[0])}, or {ahead[1]}, and in class accuracy by {ahead[2]}." in page


def test_other_recipes():
    found, page = next(iter(scores("camera_worth").values())), (DOCS / "results.md").read_text(encoding="utf-8")

    def both(name):
        return "{} ({})".format(*(per_cent(found[name][metric]["mean"]) for metric in SHOWN))

    assert f"EfficientNet without heights {both('network')}" in page
    fusions = [both(f"fusion of {what}o and heights{FORBIDDEN}") for what in ("", "image, ")]
    assert "o and heights {}, and {} when".format(*fusions) in page
    assert f"a forest on all of these {both('forest on heights, o and image scores')}" in page


def test_the_street_that_was_scored_once():
    methods = json.loads((DOCS / "results" / "other_street.json").read_text(encoding="utf-8"))["methods"]
    for name, *quoted in table("Another real street"):
        found = methods[name.replace("shipped network", "network")]
        assert quoted == [per_cent(found[metric]) for metric in SHOWN]
    page = (DOCS / "results.md").read_text(encoding="utf-8")
    segnets = json.loads((DOCS / "results" / "other_street_segnet.json").read_text(encoding="utf-8"))["methods"]
    free, bound = ([per_cent(segnets[way][metric]) for metric in SHOWN] for way in ("network", f"network{FORBIDDEN}"))
    assert f"{free[0]} % and a class accuracy of {free[1]}, or {bound[0]} and {bound[1]} with unknown forbidden" in page


def test_the_crowd_that_is_not_there():
    counts = json.loads((DOCS / "results" / "crowd.json").read_text(encoding="utf-8"))
    page = (DOCS / "results.md").read_text(encoding="utf-8")
    shipped, without, segnets = (counts[name]["map"] for name in list(counts)[:3])
    after = counts["shipped network"]["after the CRF"]
    ends = {"s": shipped, "w": without, "t": segnets}
    cells = {key: "{} to {} cells".format(min(one["called"]), max(one["called"])) for key, one in ends.items()}
    right = {key: sum(one["right"]) for key, one in ends.items()}
    labelled = sum(counts["labelled"])
    assert f"it calls {cells['s']} of each *pedestrian*, and of the {labelled} cells" in page
    assert f"it finds {right['s']}; after the CRF, {sum(after['right'])}." in page
    assert f"it calls {cells['w']} of each frame *pedestrian*, and finds {right['w']}." in page
    assert f"finds {right['t']}, and calls {cells['t']} *pedestrian*" in page
    lecture = (DOCS.parent / "notebooks" / "src" / "00_tour.py").read_text(encoding="utf-8")
    assert f"calls [{without['called'][-1]} cells](../docs/results/crowd.json) of this frame *pedestrian*" in lecture
    assert (without["right"][-1], counts["labelled"][-1]) == (7, 10)  # "finds seven" of "the ten true cells"


def test_cars_on_their_tops():
    found = json.loads((DOCS / "results" / "overturned.json").read_text(encoding="utf-8"))
    top, wheels = (interval(found["called car"][way]) for way in ("on its top", "on its wheels"))
    page = " ".join((DOCS / "results.md").read_text(encoding="utf-8").split())
    top, high = top.replace(" (", " % (", 1), interval(found["difference"])
    assert f"{top} of the cells of cars on their tops *car*, and {wheels} on their wheels: {high}" in page
    for way, counts in found["counts"].items():
        share = sum(counts["called car"]) / sum(counts["cells"])
        assert share == pytest.approx(found["called car"][way]["mean"])


def test_memory():
    for data, cells, *quoted, gain in table("Memory for classes"):
        found = scores("memory")[data][cells]
        ways = ("one frame", "mean of five maps", "memory")
        assert quoted == [per_cent(found["methods"][way]["pixel accuracy"]["mean"]) for way in ways]
        assert gain == interval(found["gain"]["pixel accuracy"])


def test_filters():
    filters = scores("occupancy")["HDL-64E"]["paper"]
    for name, *quoted in table("Occupancy filters"):
        found = filters[name]
        recalls = [row[state] / sum(row) for state, row in enumerate(found["confusion"][:3])]
        expected = [per_cent(recall) for recall in recalls]
        precision = found["dynamic"]["precision"]
        expected.append("-" if precision is None else per_cent(precision))
        expected.append(per_cent(found["smear"]["occupied"]))
        assert quoted == [*expected, per_cent(found["hit cells"]["walking pedestrians, to 25 m"]["dynamic"])]
