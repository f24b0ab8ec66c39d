"""Pages and the JSON API of participants."""
