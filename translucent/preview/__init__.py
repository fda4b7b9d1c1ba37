"""The previewer: its state (pure), the work behind it, panels and window. Only the last two need the extra ``ui``."""
