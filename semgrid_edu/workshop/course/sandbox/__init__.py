"""Grading in two processes: a student's answers in one, which can do no harm, and the tests in another."""
