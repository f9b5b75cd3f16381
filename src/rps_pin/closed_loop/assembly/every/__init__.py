"""Every assembly mode: all complex solutions of the closures, the real ones among them proven."""
