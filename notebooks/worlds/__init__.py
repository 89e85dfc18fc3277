"""Toy worlds with exact answers, and figures, for a single lecture: one module per topic.

`worlds/lecture_NN_topic.py` belongs to lecture NN, the first that shows it. A lecture writes
`from worlds.lecture_02_boxes import Box`, because a kernel's working directory is the notebook's folder. A companion is
one folder deeper, so its import cell begins with `import sys` and `sys.path.append("..")`. An exercise imports
semgrid_edu alone, because a student's copy has no `worlds/` beside it. Tests find the folder by pytest's `pythonpath`.
"""
