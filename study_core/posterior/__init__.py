"""The posterior over reward weights: prior, adaptive Metropolis, diagnostics, and the run that joins them."""
