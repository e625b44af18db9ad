"""The missing-effect workflow: where simulation and measurement disagree, what is missing, and what to do next."""
