"""How the network trains: four frames overfitted, end to end against two stages."""
