"""Version of the toolkit."""

from importlib.metadata import version

#: Version of the installed distribution.
VERSION = version("translucent-shading")
