"""Small worlds and measurements that the lectures show."""
