"""Things that stand or move on a street, each a mesh with materials."""
