"""The command line ends a mistake in one line that names it."""

import pytest

from semgrid_edu.cli import run


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["data", "make", "sample", "FILE"], r"FILE.*: Not a directory"),
        (["demo", "--out", "FILE"], r"FILE: File exists"),
        (["demo", "--kitti", "FILE"], r"--kitti, --date, --drive: expected all three or none, found only --kitti"),
        (["data", "verify", "FILE"], r"FILE: expected folders of samples"),
        (["reproduce", "occupancy", "--out", "FOLDER"], r"FOLDER: expected a file to write, found a folder"),
        (["reproduce", "occupancy", "--out", "FILE/scores.json"], r"FILE: File exists"),
        (["evaluate", "--data", ".", "--weights", ".", "--out", "FOLDER"], r"FOLDER: expected a file to write"),
    ],
)
def test_a_mistake_ends_in_one_line(tmp_path, monkeypatch, arguments, message):
    (tmp_path / "FILE").write_text("a file where a folder should be")
    (tmp_path / "FOLDER").mkdir()
    arguments = [str(tmp_path / a) if a.startswith(("FILE", "FOLDER")) else a for a in arguments]
    monkeypatch.setattr("sys.argv", ["semgrid-edu", *arguments])
    with pytest.raises(SystemExit, match=f"^semgrid-edu: .*{message}") as caught:
        run()
    assert "\n" not in str(caught.value)
