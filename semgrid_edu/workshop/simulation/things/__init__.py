"""Objects on a street, each a mesh with materials."""
