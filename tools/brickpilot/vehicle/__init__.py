"""One vehicle: its model file, the compiled plant, scenarios, flights, and what the firmware can compensate."""
