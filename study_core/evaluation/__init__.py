"""How well models of a person's preferences predict that person's answers."""
