"""The course: its notebooks built from percent sources, its exercises, its grading, its equation register."""
