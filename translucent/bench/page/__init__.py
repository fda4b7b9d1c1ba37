"""The page of a report: HTML and figures from the record alone, without OpenGL."""
