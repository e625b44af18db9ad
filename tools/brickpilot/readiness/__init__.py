"""What a data set is worth before discovery: what it can show, what it cannot, and what to record next."""
