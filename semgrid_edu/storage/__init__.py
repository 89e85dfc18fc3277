"""Safe storage on disk: atomic writes, checked reading, tensors and provenance."""
