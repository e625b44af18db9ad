"""How messages travel between this program and a brick."""
