"""Composes a term for what no named effect explains: a basis of terms, their screen, their fits, and their C source."""
