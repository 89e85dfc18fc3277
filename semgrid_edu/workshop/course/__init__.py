"""The course: notebooks, exercises and their grading."""
