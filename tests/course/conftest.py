"""What tests of courses share."""

from nbgrader_scores import alembic_asked_once  # noqa: F401 (a fixture for all tests here)
