"""The command line. Each command has a file of its own, and no other folder prints."""
