"""The CPU ring: frames without OpenGL, from rays that Embree casts and float64 arithmetic decides."""
