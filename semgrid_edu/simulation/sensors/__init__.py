"""What takes in the street: camera, LIDAR, GPS, and the truth that only a simulation knows."""
