"""Small worlds, small networks and measurements that the lectures show."""
