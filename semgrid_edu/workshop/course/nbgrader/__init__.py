"""Exercises laid out as an nbgrader course, collected and graded."""
