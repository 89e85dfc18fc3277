"""Notebooks built from percent sources, and the rules that they are held to."""
