"""What a data set is worth before discovery: what it tells, what it cannot, and what to record."""
