"""The street: ground, plan and scenery, and who moves along it."""
