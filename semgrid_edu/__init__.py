"""Probabilistic bird's-eye semantic perception, from LIDAR and camera to a semantic grid."""

import os

# OpenMP's threads spin while they wait and so starve one another as soon as anything else runs: on two busy cores a
# frame took 1.2 s instead of 0.07 s. OpenMP reads this once, when torch or numba loads it.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
