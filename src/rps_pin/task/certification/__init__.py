"""Boxes of task coordinates that are proven, of any mechanism: equations, Newton, growth."""
