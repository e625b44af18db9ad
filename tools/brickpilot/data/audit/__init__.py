"""The audit: finds damaged samples, wrong channels and wrong clocks in measured data, before anything is fitted."""
