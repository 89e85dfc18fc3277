"""The paper's experiments as units of work: data, training, scores, times and figures."""
