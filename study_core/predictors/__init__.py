"""What predicts a person's answers: one file for each predictor, all with the interface of `predictor`."""
