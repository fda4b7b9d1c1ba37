"""The previewer: its state (pure), the work behind it, panels and window. Needs the extra ``ui`` for the window only."""
