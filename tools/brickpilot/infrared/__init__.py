"""The infrared link to an RCX: tower is the device on this end, lnp the packets of brickOS."""
