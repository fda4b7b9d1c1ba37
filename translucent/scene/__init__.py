"""Contents of a picture: bodies and their surfaces, cameras, lights and environments."""
