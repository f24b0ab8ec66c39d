"""The report on a study: what predictors came to, as one web page that holds everything it shows."""
