"""One function for each thing that a person, an experimenter or the engine can cause."""
