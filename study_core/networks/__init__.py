"""Features learned by small networks from a person's answers (Katz et al. 2021): one file for each part of it."""
