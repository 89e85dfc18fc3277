"""The runs of the paper's experiments: data, training, scores, and what else its tables and claims need."""
