"""The sensors: rays, camera, LIDAR and GPS, and what is true of what they see."""
