"""The table of the stages' graphical models names only what exists."""

from semgrid_edu.workshop.course import registers
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS, read_percent
from semgrid_edu.workshop.course.registers import STAGES, StageModel, find_code, stage_table

EXAMPLE = StageModel(
    "bof",
    "BOF: four cells",
    model="semgrid_edu.occupancy.bof_predict",
    check="tests/occupancy/test_bof.py::test_exact",
    lecture="03_bof#bof-predict",
)


def has_cell(place):
    name, _, tag = place.partition("#")
    cells = read_percent(NOTEBOOKS / "src" / f"{name}.py").cells
    return any(tag in cell.metadata.get("tags", []) for cell in cells)


def test_what_a_stage_names_exists():
    for stage in STAGES:
        assert callable(find_code(stage.model)), stage.id
        path, is_test, test = stage.check.partition("::")
        if is_test:
            assert f"def {test}(" in (NOTEBOOKS.parent / path).read_text(encoding="utf-8"), stage.id
        else:
            assert has_cell(stage.check), stage.id
        assert stage.lecture is None or has_cell(stage.lecture), stage.id


def test_each_stage_is_there_once():
    assert len({stage.id for stage in STAGES}) == len(STAGES)


def test_a_row_links_model_check_and_lecture(monkeypatch):
    in_a_cell = StageModel("tour", "All", model="semgrid_edu.grid.GridSpec", check="deeper/graphical_models#all")
    monkeypatch.setattr(registers, "STAGES", (EXAMPLE, in_a_cell))
    _, _, bof, tour = stage_table().splitlines()
    assert bof == (
        "| BOF: four cells | [`bof_predict`](../semgrid_edu/occupancy/bof.py) "
        "| [`test_exact`](../tests/occupancy/test_bof.py) | [03](03_bof.ipynb), `bof-predict` |"
    )
    assert "| [graphical models](deeper/graphical_models.ipynb), `all` | to come |" in tour
