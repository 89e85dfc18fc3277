"""Probabilistic bird's-eye semantic perception, from LIDAR and camera to a semantic grid."""
