"""How wrong labels made from LIDAR are, and what each rule of making them costs."""
