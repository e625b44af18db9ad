"""Links to a brick: transports, messages, sessions, and the infrared tower of the RCX."""
