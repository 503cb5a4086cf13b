"""Where rooms meet: one file a stage of the protocol, and what all stages share in `frame`."""
