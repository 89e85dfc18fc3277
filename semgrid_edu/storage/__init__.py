"""What is kept on disk, and how safely: files, tensors, provenance, and the worker processes that write them."""
