"""Which version of the toolkit this is."""

from importlib.metadata import version

#: Of the installed distribution.
VERSION = version("translucent-shading")
