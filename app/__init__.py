"""The application around the science: store, services, engine, stage, pages, command line."""
