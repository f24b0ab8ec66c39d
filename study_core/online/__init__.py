"""Online feature learning: a feature learned from a person's own answers, in the middle of their session."""
