"""The course: notebooks built from percent sources, exercises, their grading, and the equation register."""
