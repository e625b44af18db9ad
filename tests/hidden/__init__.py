"""Data sets with a hidden effect, made by independent physics. Imports nothing of the program under test."""
