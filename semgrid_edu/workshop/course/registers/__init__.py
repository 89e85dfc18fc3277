"""Registers that the course is checked against: equations, and the graphical model of each stage."""
