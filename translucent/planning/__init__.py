"""Planning of the passes that a scene needs, each with its reason; needs no GPU."""
