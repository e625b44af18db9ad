"""The work of the commands as functions, with checks of the arguments."""
