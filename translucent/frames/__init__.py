"""What a renderer gives back: frames, their layers and films, and how far they are from the truth."""
