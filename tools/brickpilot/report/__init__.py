"""Pages and plots that the commands write."""
