"""The CRF's fast twins: the permutohedral lattice, the separable Gaussian and mean field in compiled loops."""
