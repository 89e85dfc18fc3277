"""How the network trains: four frames overfitted, and real streets."""
