"""What is in a picture: bodies and their surfaces, cameras, lights and environments."""
