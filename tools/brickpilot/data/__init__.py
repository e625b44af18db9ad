"""Data sets: the description file, the tables of columns, units, held-out runs, and the audit of damaged data."""
