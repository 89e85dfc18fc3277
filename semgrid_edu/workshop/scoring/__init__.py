"""Scoring of semantic grids: confusion matrices per frame, baselines, and intervals over drives and seeds."""
