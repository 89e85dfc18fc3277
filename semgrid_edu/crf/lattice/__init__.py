"""The permutohedral lattice (Adams 2010): Gaussian filtering in five dimensions by splat, blur and slice."""
