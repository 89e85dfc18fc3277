"""Measurements that lectures and docs/results.md quote: filter, CRF, ground truth, training, and a new drive."""
