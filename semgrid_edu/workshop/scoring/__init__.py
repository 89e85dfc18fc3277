"""One way to score a map: confusion matrices frame by frame, baselines, and intervals over drives and seeds."""
