"""From a scene to the passes that it needs, each with its reason; needs no GPU."""
