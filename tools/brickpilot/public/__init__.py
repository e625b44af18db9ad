"""The work of the commands as functions, with checks of what a caller gives."""
