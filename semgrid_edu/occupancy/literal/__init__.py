"""The literal twins of the occupancy filters: plain numpy, one term of the formula at a time."""
