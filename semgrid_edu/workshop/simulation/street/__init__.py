"""The street: ground, plan, scenery and road users."""
