"""Give each entry of an exercise's catalogue its own test."""

import pytest

pytest.register_assert_rewrite("grader_checks")


def pytest_generate_tests(metafunc):
    """Run `test_entry` once for each entry of the class it belongs to."""
    if "entry" in metafunc.fixturenames:
        entries = metafunc.cls.entries
        metafunc.parametrize("entry", entries, ids=[f"{entry.task}: {entry.title}" for entry in entries])
