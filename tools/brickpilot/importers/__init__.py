"""Logs of other tools turned into data sets. Each importer writes a new folder whole, or nothing."""
