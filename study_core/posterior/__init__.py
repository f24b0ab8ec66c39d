"""The posterior over reward weights: prior, warm-up, chains, diagnostics, evidence."""
