"""Figures of single lectures."""
