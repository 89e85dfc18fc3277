"""Measurements that lectures and README quote: filter, CRF, ground truth, training, and a new drive."""
