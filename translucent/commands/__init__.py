"""One verb of the command line per file; heavy imports happen inside, so that ``--help`` is quick."""
