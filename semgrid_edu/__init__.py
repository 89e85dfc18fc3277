"""Probabilistic bird's-eye semantic perception, from LIDAR and camera to a semantic grid."""

__version__ = "0.1.0"
