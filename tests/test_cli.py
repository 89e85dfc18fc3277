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
    ],
)
def test_a_mistake_ends_in_one_line(tmp_path, monkeypatch, arguments, message):
    (tmp_path / "FILE").write_text("a file where a folder should be")
    arguments = [str(tmp_path / "FILE") if argument == "FILE" else argument for argument in arguments]
    monkeypatch.setattr("sys.argv", ["semgrid-edu", *arguments])
    with pytest.raises(SystemExit, match=f"^semgrid-edu: .*{message}") as caught:
        run()
    assert "\n" not in str(caught.value)
