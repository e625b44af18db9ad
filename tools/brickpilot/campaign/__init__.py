"""Campaigns: many flights of drawn robots, their figures as a table, and what the table says."""
