"""The transport of messages between this program and a brick."""
