"""Experiments, each one a command: networks and baselines scored, filters compared, training regimes compared."""
