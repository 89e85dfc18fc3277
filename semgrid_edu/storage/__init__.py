"""What is kept on disk, and how safely: files, tensors, provenance, worker processes."""
