"""What is kept is named by the code that made it: any change of what the code does is seen, words aren't."""

import shutil
from pathlib import Path

import pytest

import semgrid_edu
from semgrid_edu.datasets import kitti_raw, label_policies, training_arrays
from semgrid_edu.storage.provenance import ROOT, code_hash, import_closure

PACKAGE = Path(semgrid_edu.__file__).parent
ARRAYS = [Path(module.__file__).relative_to(ROOT) for module in (training_arrays, kitti_raw)]
LABELS = [Path(label_policies.__file__).relative_to(ROOT)]
READERS, FILTER = "datasets", "occupancy"


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    """The folder of a copy of the package."""
    root = tmp_path_factory.mktemp("copied")
    shutil.copytree(PACKAGE, root / PACKAGE.name, ignore=shutil.ignore_patterns("workshop", "__pycache__"))
    return root


@pytest.fixture(scope="module")
def keys(copied):
    """What gives the keys of arrays and labels, after a change in a module that is undone at once."""

    def after(module: str, old: str, new: str) -> tuple[str, str]:
        path = copied / PACKAGE.name / module
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1))
        found = tuple(code_hash([copied / one for one in files], copied) for files in (ARRAYS, LABELS))
        path.write_text(text)
        return found

    return after


@pytest.fixture(scope="module")
def before(keys):
    """The keys of arrays and labels as the package stands."""
    return keys("camera.py", "", "")


def test_a_change_of_how_labels_are_made_changes_theirs_alone(keys, before):
    (arrays, labels), (same, other) = before, keys("datasets/ground_truth/making.py", "1.5", "2.5")
    assert arrays == same
    assert labels != other


@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        (f"{READERS}/frames.py", "Read the returns of one scan.", "Read all returns of a scan."),
        (f"{READERS}/frames.py", "metres. KITTI's HDL-64E", "metres. The HDL-64E"),
        (f"{READERS}/kitti_raw.py", "# a scan that was never recorded", "# what was never recorded"),
        (f"{READERS}/frames.py", "class FrameSequence", "\n\nclass FrameSequence"),
        ("networks/fusion.py", "N_REDUCED = 16", "N_REDUCED = 17"),
        ("datasets/training_set.py", "class Sample", "class Example"),
    ],
)
def test_words_and_what_makes_no_arrays_change_nothing(keys, before, module, old, new):
    assert before == keys(module, old, new)


def test_names_are_followed_to_the_module_that_defines_them(tmp_path):
    package = tmp_path / "tiny"
    package.mkdir()
    files = {
        "__init__": "from tiny.one import first as start\nfrom tiny.two import second\nOWN = 1\n",
        "one": "import os.path\nfrom numpy import array\ndef first():\n    from tiny import three\n",
        "two": "second = 2",
        "three": "",
    }
    for name, text in files.items():
        (package / f"{name}.py").write_text(text)

    def closure(statement):
        (tmp_path / "script.py").write_text(statement)
        found = {path.stem for path in import_closure([tmp_path / "script.py"], tmp_path)}
        return sorted(found - {"script"})

    assert closure("from tiny import second") == ["two"]
    assert closure("from tiny import start") == ["one", "three"]
    assert closure("import tiny.two as t") == ["two"]
    assert closure("from tiny import OWN") == closure("import tiny") == ["__init__", "one", "three", "two"]


@pytest.mark.parametrize("files", [ARRAYS, LABELS], ids=["arrays", "labels"])
def test_the_closure_is_what_makes_arrays_or_labels_and_no_more(files):
    found = {path.relative_to(PACKAGE).as_posix() for path in import_closure([ROOT / one for one in files])}
    assert {f"{name}.py" for name in ("camera", "grid", "frame", "labels", "storage/reading")} < found
    assert {f"{READERS}/{name}.py" for name in ("training_arrays", "grid_truth", "frames")} < found
    assert {f"{FILTER}/{name}.py" for name in ("cmcdot", "steps", "sensor", "state", "world")} < found
    assert not [name for name in found if name.startswith(("networks", "training", "crf", f"{FILTER}/literal"))]
    assert not [name for name in found if name.endswith("__init__.py")]


def test_a_reader_outside_of_the_package_counts_with_what_it_imports(tmp_path):
    reader = tmp_path / "my_reader.py"
    reader.write_text(
        "from semgrid_edu.occupancy import State\nimport semgrid_edu.grid\nimport numpy\ndef one():\n    return 1\n"
    )
    found = import_closure([reader])
    assert {path.name for path in found} >= {"my_reader.py", "state.py", "grid.py"}
    before = code_hash([reader])
    reader.write_text(reader.read_text().replace("return 1", "return 2"))
    assert code_hash([reader]) != before
