"""The street: its ground, its plan, its scenery, and the road users that move along it."""
