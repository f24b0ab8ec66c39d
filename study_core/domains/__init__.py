"""Built-in domains, each a package built and registered exactly like a third-party plug-in."""
