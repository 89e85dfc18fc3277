"""docs/results.md quotes the committed results."""

import json
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
METRICS = ("pixel accuracy", "class accuracy")
FORBIDDEN = ", unknown forbidden"


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


def test_the_camera_beside_rules_without_one():
    left_out, _ = scores("camera_worth").values()
    picked, later = scores("camera_worth_heights").values()
    known = left_out | {
        "scores picked at the returns, o and heights, unknown forbidden": picked["network, unknown forbidden"]
    }
    for name, cells, classes in table("A real street"):
        assert cells == interval(known[name]["pixel accuracy"])
        assert classes == interval(known[name]["class accuracy"])
    page = (DOCS / "results.md").read_text(encoding="utf-8")
    above = picked["network, unknown forbidden"]
    assert per_cent(above["pixel accuracy above the height rule"]["mean"]) in page
    assert interval(above["class accuracy above the height rule"]) in page
    assert f"{per_cent(picked['network']['pixel accuracy']['mean'])} %" in page
    refined = picked["network + CRF, unknown forbidden"]["pixel accuracy above the height rule"]
    ends = interval(refined).partition(" ")[2]
    assert f"which is {per_cent(refined['mean'])} above the rule {ends}" in page
    sure, unsure, rule, forest = (
        per_cent(later[name]["pixel accuracy"]["mean"])
        for name in ("network, unknown forbidden", "network", "height rule", "forest on heights and o")
    )
    assert f"it gets {sure} %, or {unsure} if it may answer *unknown*; the rule gets {rule}, and a forest" in page
    assert f"no image either, {forest}." in page
    gains = later["network, unknown forbidden"]
    assert f"{interval(gains['pixel accuracy above the height rule']).replace(' (', ' points (')} in cells" in page
    assert f"by {interval(gains['class accuracy above the height rule'])} in class accuracy" in page


def test_the_street_that_was_scored_once():
    methods = json.loads((DOCS / "results" / "other_street.json").read_text(encoding="utf-8"))["methods"]
    for name, *quoted in table("Another real street"):
        found = methods[name.replace("shipped network", "network")]
        assert quoted == [per_cent(found[metric]) for metric in METRICS]
    page = (DOCS / "results.md").read_text(encoding="utf-8")
    segnets = json.loads((DOCS / "results" / "other_street_segnet.json").read_text(encoding="utf-8"))["methods"]
    free, bound = ([per_cent(segnets[way][metric]) for metric in METRICS] for way in ("network", f"network{FORBIDDEN}"))
    assert f"{free[0]} % and a class accuracy of {free[1]}, or {bound[0]} and {bound[1]} with unknown forbidden" in page


def test_the_crowd_that_is_not_there():
    counts = json.loads((DOCS / "results" / "crowd.json").read_text(encoding="utf-8"))
    page = (DOCS / "results.md").read_text(encoding="utf-8")
    called = {name: counts[name]["called"] for name in list(counts)[:3]}
    shipped, without, segnets = (f"{min(cells)} to {max(cells)} cells" for cells in called.values())
    assert f"it calls {shipped} of each *pedestrian*" in page
    assert f"a map that calls {without} *pedestrian*" in page
    assert f"calls {segnets} *pedestrian*" in page
    found = counts["shipped network"]
    assert f"the {min(found['labelled'])} to {max(found['labelled'])} cells that are labelled so" in page
    assert (min(found["right"]), max(found["right"])) == (1, 4)  # "one to four"


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
