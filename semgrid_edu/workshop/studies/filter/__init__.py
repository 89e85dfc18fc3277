"""The occupancy filters measured on simulated drives, and on streets that are hard for them."""
