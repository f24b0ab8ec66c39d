"""What a paper has to report about how a study was run, from its records: tables for an appendix."""
