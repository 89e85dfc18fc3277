"""The course: notebooks, registers, exercises and their grading."""
