"""The science of prefstudy: pure functions on frozen data; no database, no web, no viser."""
