"""What `crf.check` looks for: faults of shapes, of the unary term, of the states, of the kernels and of the result."""
