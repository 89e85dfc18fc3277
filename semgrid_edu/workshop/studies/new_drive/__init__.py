"""Checks that one makes on new data before a network sees them, and how far they are from what it learned from."""
