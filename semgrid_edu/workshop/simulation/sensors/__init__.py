"""The sensors (ray casting, camera, LIDAR, GPS) and the ground truth of what they see."""
