"""Results of a renderer: frames, their arrays as pictures, films, and error metrics."""
