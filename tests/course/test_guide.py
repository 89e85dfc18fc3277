"""The instructor's guide names commands that exist, and its numbers are those of exercises and lectures."""

import json
import re
from datetime import datetime

import nbformat
import pytest
from nbgrader.apps.dbapp import DbApp
from nbgrader.apps.nbgraderapp import NbGraderApp
from nbgrader.utils import is_grade, is_solution, parse_utc
from nbgrader_scores import tasks
from packaging.requirements import Requirement
from typer.main import get_command

from semgrid_edu.workshop.commands import main as cli
from semgrid_edu.workshop.course.nbgrader.build import exercise_sources
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS, built_path, lecture_sources, read_percent
from semgrid_edu.workshop.course.notebooks.minutes import reading_time

CLONE = NOTEBOOKS.parent
GUIDE = (NOTEBOOKS / "instructor" / "README.md").read_text(encoding="utf-8")
NUMBER = r"\b\d\d[a-z]?\b"
EXERCISES = {source.stem: source for source in exercise_sources()}


def minutes_of_exercise(source):
    return int(re.search(r"About (\d+) minutes", read_percent(source).cells[0].source)[1])


def commands(program):
    return [line.partition(program)[2].split() for line in re.findall(rf"{program} [^`\n]*", GUIDE)]


def test_every_command_of_ours_exists_with_its_options():
    ours = get_command(cli.app)
    for words in commands("semgrid-edu"):
        if words[0] not in ("course", "demo"):
            continue
        command = ours.commands[words[0]]
        command = command.commands[words[1]] if words[0] == "course" else command
        known = {name for parameter in command.params for name in parameter.opts}
        named = {word for word in words if re.fullmatch(r"--[a-z-]+", word)}
        assert named <= known, words


def test_every_command_of_nbgrader_exists():
    found = [words for words in commands("nbgrader") if words[0].isidentifier()]
    assert {words[0] for words in found} >= {"autograde", "db", "export", "generate_feedback", "zip_collect"}
    for words in found:
        assert words[0] in NbGraderApp.subcommands, words
        assert words[0] != "db" or words[1] in DbApp.subcommands


def test_a_platforms_file_names_are_read():
    pattern = re.search(r"named_regexp='(.*)'", GUIDE)[1]
    found = re.match(pattern, re.search(r"This is for `(ada_\S+)`", GUIDE)[1]).groupdict()
    assert (found["student_id"], found["file_id"]) == ("ada", "01_bayes")
    for time, hour in (("17-12-00", 17), ("05-32-10", 5), ("23-59-59", 23), ("00-00-00", 0)):
        stamp = re.match(pattern, f"ada_attempt_2027-03-31-{time}_01_bayes.ipynb")["timestamp"]
        assert parse_utc(stamp) == datetime(2027, 3, 31, hour)


def test_the_minutes_a_point_are_right_to_half_a_minute():
    rows = re.findall(r"^\| `(\w+)` \| (\d+) \| [\d ]+= (\d+) \| ([\d /]+) \|", GUIDE, re.M)
    assert {name for name, *_ in rows} == set(EXERCISES)
    for name, minutes, total, each in rows:
        assert float(each.replace(" 1/2", ".5")) == pytest.approx(int(minutes) / int(total), abs=0.26), name


def test_the_written_question_comes_last():
    assert [n for n, source in EXERCISES.items() if not is_solution(read_percent(source).cells[-1])] == []


def test_the_table_of_points_is_right():
    for name in EXERCISES:
        check_points(name)


def check_points(name):
    minutes, points = re.search(rf"^\| `{name}` \| (\d+) \| ([\d =]+) \|", GUIDE, re.MULTILINE).groups()
    assert int(minutes) == minutes_of_exercise(EXERCISES[name])
    source = read_percent(EXERCISES[name])
    worth = {c.metadata.nbgrader.grade_id: c.metadata.nbgrader.points for c in source.cells if is_grade(c)}
    by_task, total = points.split(" = ")
    assert int(total) == sum(worth.values()) == sum(map(int, by_task.split()))
    written = [c.metadata.nbgrader.grade_id for c in source.cells if is_grade(c) and is_solution(c)]
    assert [worth[one] for one in written] == [int(by_task.split()[-1])], "the last task is the written question"
    assert set(written) < set(tasks(EXERCISES[name]))


def number_of(name):
    """The number of a lecture or an exercise, such as "01b"."""
    return name.partition("_")[0]


def test_the_hours_of_the_eight_weeks_are_right():
    lectures = {
        number_of(s.stem): reading_time(nbformat.read(built_path(s), as_version=4)).minutes for s in lecture_sources()
    }
    exercises = {number_of(name): minutes_of_exercise(source) for name, source in EXERCISES.items()}
    weeks = re.findall(r"^\| \d \| ([^|]+) \| ([^|]+) \| ([^|]+) \|", GUIDE, re.MULTILINE)
    assert len(weeks) == 8
    taught = [number for lecture, _, _ in weeks for number in re.findall(NUMBER, lecture)]
    assert sorted(taught) == sorted(lectures)
    for lecture, exercise, hours in weeks:
        counted = sum(lectures[n] for n in re.findall(NUMBER, lecture))
        counted += sum(exercises[n] for n in re.findall(NUMBER, exercise))
        assert eval(hours.replace(" 1/2", ".5")) == pytest.approx(counted / 60, abs=0.75), lecture


def test_files_for_other_places_are_what_these_places_read():
    container = json.loads((CLONE / ".devcontainer" / "devcontainer.json").read_text())
    assert container["image"].startswith("python:3.11")
    assert container["postCreateCommand"] == "python make.py environment"
    options, package = (CLONE / ".binder" / "requirements.txt").read_text().splitlines()
    assert options == "-c ../constraints.txt"
    assert (CLONE / ".binder" / options.removeprefix("-c ")).resolve() == (CLONE / "constraints.txt").resolve()
    assert package == "-e ."
    assert Requirement((CLONE / ".binder" / "runtime.txt").read_text().strip().replace("-", "==")).name == "python"
